// Made by a test of host/src/verbs/view/typescript.rs, which also says how to make it anew.

/** Version of the data. */
export const SCHEMA = 3;

/** Channels of a flight, in the order of its series. */
export const CHANNELS = [
  { key: "roll_rad", label: "roll", unit: "rad", angle: true },
  { key: "pitch_rad", label: "pitch", unit: "rad", angle: true },
  { key: "heading_rad", label: "heading", unit: "rad", angle: true },
  { key: "yaw_rate_radps", label: "yaw rate", unit: "rad/s", angle: false },
  { key: "angular_velocity_radps", label: "angular velocity", unit: "rad/s", angle: false },
  { key: "horizontal_velocity_mps", label: "horizontal velocity", unit: "m/s", angle: false },
  { key: "vertical_velocity_mps", label: "vertical velocity", unit: "m/s", angle: false },
] as const;

/**
 * A segment as it is drawn. Axes are those of the segment: left, dorsal, cranial.
 */
export type Shape = {
/**
 * Name.
 */
name: string,
/**
 * Half the extents of what the model's air sees of it (m), equipment included.
 */
half_extents_m: [number, number, number],
/**
 * From its joint to its centre of gravity (m).
 */
cg_m: [number, number, number],
/**
 * Half the extents of the person in it (m), without equipment.
 */
person_half_extents_m: [number, number, number],
/**
 * From its joint to the middle of the person in it (m).
 */
person_middle_m: [number, number, number],
/**
 * Its joint in the posture in which a skin is made (m), axes of the body.
 */
rest_joint_m: [number, number, number],
/**
 * `body_from_segment` in that posture.
 */
rest_attitude: [number, number, number, number], };

/**
 * What a person wears.
 */
export type Worn = {
/**
 * A helmet.
 */
helmet: boolean,
/**
 * Shoes.
 */
shoes: boolean,
/**
 * A parachute on the back.
 */
rig: boolean,
/**
 * A weight belt.
 */
weight_belt: boolean,
/**
 * Name of the suit.
 */
suit: string, };

/**
 * What a column of the series is.
 */
export type Column = {
/**
 * Name.
 */
name: string,
/**
 * Numbers of a row.
 */
width: number,
/**
 * Numbers are multiples of this.
 */
step: number, };

/**
 * Columns over time as the page takes them.
 */
export type Packed = {
/**
 * The columns, in order.
 */
columns: Array<Column>,
/**
 * Rows.
 */
rows: number,
/**
 * For each number of each column, rounded to its step, the difference to the row before: zigzag, seven bits a
 * byte, low ones first; then gzip, then base64.
 */
data: string, };

/**
 * Estimated inputs over time.
 */
export type Estimated = {
/**
 * Columns over time.
 */
series: Packed,
/**
 * Why they are not to be trusted.
 */
doubt: string | null, };

/**
 * A run as the page shows it.
 */
export type Run = {
/**
 * Name for people.
 */
name: string,
/**
 * How segments are drawn.
 */
shapes: Array<Shape>,
/**
 * What the skydiver wears.
 */
worn: Worn,
/**
 * Root mean square of measured minus simulated, over all frames.
 */
rms: Record<string, number>,
/**
 * Largest size of the measured channel.
 */
amplitude: Record<string, number>,
/**
 * Frames of the recording.
 */
frames: number,
/**
 * Velocity of the air (m/s), north, west, up.
 */
air_velocity_mps: [number, number, number],
/**
 * What there is to see.
 */
series: Packed,
/**
 * Inputs that were estimated, where that was asked for.
 */
estimated: Estimated | null, };

/**
 * What the page needs to fly by itself.
 */
export type FlyData = {
/**
 * The model, see [`bodyflight_viewer::setup`].
 */
setup: Array<number>,
/**
 * How segments are drawn.
 */
shapes: Array<Shape>,
/**
 * What the skydiver wears.
 */
worn: Worn,
/**
 * Names of the ways to begin.
 */
starts: Array<string>,
/**
 * Names of the controls.
 */
controls: Array<string>,
/**
 * Parts of a frame with their numbers.
 */
layout: Array<[string, number]>,
/**
 * Parts of a segment with their numbers.
 */
segment_layout: Array<[string, number]>, };

/**
 * What a page does.
 */
export type Mode = "replay" | "live" | "fly";

/**
 * An input file, to tell where a page comes from.
 */
export type Input = {
/**
 * Name of the file, without its folder.
 */
file: string,
/**
 * SHA-256 of its content, hexadecimal.
 */
sha256: string, };

/**
 * Where a page comes from.
 */
export type Provenance = {
/**
 * Version of bodyflight.
 */
version: string,
/**
 * The command that made it.
 */
command: string,
/**
 * What was read.
 */
inputs: Array<Input>, };

/**
 * Everything that a page is given.
 */
export type PageData = {
/**
 * [`SCHEMA`].
 */
schema: number,
/**
 * What the page does.
 */
mode: Mode,
/**
 * Title.
 */
title: string,
/**
 * Where it comes from.
 */
provenance: Provenance,
/**
 * Flights.
 */
runs: Array<Run>,
/**
 * The report of `bodyflight discover`.
 */
discovery: unknown,
/**
 * For flying.
 */
fly: FlyData | null, };

/**
 * An estimate of the unit.
 */
export type LiveEstimate = {
/**
 * Muscle input and damping coefficients, pitch, yaw, roll each.
 */
state: [number, number, number, number, number, number],
/**
 * Their variances.
 */
variance: [number, number, number, number, number, number],
/**
 * Normalised innovation squared.
 */
nis: number, };

/**
 * The progress of a stream.
 */
export type Live = {
/**
 * Time of the flight (s).
 */
time_s: number,
/**
 * Samples sent.
 */
sent: number,
/**
 * Estimates received.
 */
estimates: number,
/**
 * From the last sample that brought an estimate to the estimate (ms).
 */
latency_ms: number | null,
/**
 * Samples the unit misses.
 */
missing: number,
/**
 * Samples the unit dropped because it was behind.
 */
dropped: number,
/**
 * Deadlines the unit missed.
 */
deadline_missed: number,
/**
 * The last estimate.
 */
estimate: LiveEstimate | null, };

/**
 * What came over a network.
 */
export type Received = {
/**
 * Frames.
 */
frames: number,
/**
 * Samples that never came, or not whole.
 */
lost: number, };

/**
 * What the page is told of the simulated body.
 */
export type AvatarState = {
/**
 * Time since which it flies by itself (s).
 */
since_s: number,
/**
 * Times it began anew: asked to, after a gap of the stream, or since it had left every plausible range.
 */
restarts: number, };

/**
 * What goes with a picture.
 */
export type Look = {
/**
 * Time of the flight (s).
 */
time_s: number,
/**
 * Progress of a stream to a unit.
 */
stream: Live | null,
/**
 * Progress of a stream that is only listened to.
 */
received: Received | null,
/**
 * The simulated body, once it flies.
 */
avatar: AvatarState | null, };
