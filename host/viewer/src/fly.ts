// Fly: keys move the joints, the core flies in the page.
import { Core } from "./core";
import { CHANNELS, type FlyData, type PageData } from "./data";
import { button, element, save, typing } from "./dom";
import { Plots } from "./plots";
import { provenance, shell } from "./shell";
import { Stage } from "./stage";

const RATE = 240;
/** Seconds that the plots show. */
const SHOWN = 20;

interface Key {
  key: string;
  control: string;
  share: number;
  does: string;
}
const KEYS: Key[] = [
  { key: "a", control: "turn", share: 1, does: "turn left" },
  { key: "d", control: "turn", share: -1, does: "turn right" },
  { key: "w", control: "legs", share: 1, does: "forward: legs stretched" },
  { key: "s", control: "legs", share: -1, does: "backward: legs bent" },
  { key: "q", control: "side-slide", share: 1, does: "slide left" },
  { key: "e", control: "side-slide", share: -1, does: "slide right" },
  { key: "r", control: "arch", share: 1, does: "arch: faster" },
  { key: "f", control: "arch", share: -1, does: "de-arch: slower" },
  { key: "g", control: "press", share: 1, does: "press arms and thighs" },
  { key: "b", control: "arms-down", share: 1, does: "arms down" },
  { key: "n", control: "left-arm-in", share: 1, does: "left arm in" },
  { key: "m", control: "right-arm-in", share: 1, does: "right arm in" },
];
const MUSCLE: [string, number, number][] = [
  ["i", 0, 1],
  ["k", 0, -1],
  ["u", 1, 1],
  ["o", 1, -1],
  ["j", 2, 1],
  ["l", 2, -1],
];
const MUSCLE_SHARE = 1;

export function fly(data: PageData, flight: FlyData): void {
  const core = new Core(flight);
  const { header, main, aside, footer } = shell(data);
  const stage = new Stage(main, flight.shapes);
  const legend = element("div", { class: "over legend", id: "legend", "aria-live": "off" });
  main.append(legend);
  let start = 0;
  let running = true;
  let recorded: Float32Array[] | null = null;
  const down = new Set<string>();
  const time = new Float64Array(SHOWN * 30);
  const shown = [1, 0, 3, 5, 6];
  const lines = shown.map(() => new Float64Array(time.length).fill(NaN));

  const starts = element(
    "select",
    { id: "start", "aria-label": "posture at the start" },
    ...flight.starts.map((name, k) => element("option", { value: String(k) }, name)),
  );
  starts.addEventListener("change", () => {
    start = Number(starts.value);
    begin();
    starts.blur();
  });
  const recording = button("record", "Record the flight; again to save it", () => (recorded ? finish() : record()));
  const message = element("span", { id: "message", role: "status" });
  header.append(
    starts,
    button("start again", "Back to the beginning (0)", begin),
    button("pause", "Stop and go on (space)", () => pause()),
    recording,
    message,
  );
  const cost = element("span", { class: "faint", id: "cost" });
  footer.append(
    element("span", { class: "faint" }, "Hold a key. Shift: half as much."),
    element("span", { style: "flex:1" }),
    cost,
  );

  const help = element("dl", { id: "keys" });
  for (const { key, does } of KEYS)
    help.append(element("dt", {}, element("span", { class: "key" }, key.toUpperCase())), element("dd", {}, does));
  help.append(
    element(
      "dt",
      {},
      element("span", { class: "key" }, "I K"),
      " ",
      element("span", { class: "key" }, "U O"),
      " ",
      element("span", { class: "key" }, "J L"),
    ),
    element("dd", {}, "muscle input: pitch, yaw, roll"),
  );
  aside.append(element("section", {}, element("h2", {}, "Keys"), help));
  const plots = new Plots(
    aside,
    time,
    shown.map((k, n) => ({
      key: CHANNELS[k].key,
      title: CHANNELS[k].label,
      unit: CHANNELS[k].unit,
      lines: [{ label: "flown", ink: "simulated", values: lines[n] }],
    })),
    () => {},
  );
  aside.append(joints(core, flight), damping(core), provenance(data));

  function begin(): void {
    core.exports.begin(start);
    down.clear();
    for (const line of lines) line.fill(NaN);
    time.forEach((_, k) => {
      time[k] = k / 30 - SHOWN;
    });
    if (recorded) recorded = [];
  }

  function pause(): void {
    running = !running;
  }

  function record(): void {
    recorded = [];
    recording.setAttribute("aria-pressed", "true");
    recording.textContent = "save";
  }

  function finish(): void {
    const frames = recorded ?? [];
    recorded = null;
    recording.removeAttribute("aria-pressed");
    recording.textContent = "record";
    if (frames.length < 2) return;
    const all = new Float32Array(frames.length * frames[0].length);
    for (const [k, frame] of frames.entries()) all.set(frame, k * frame.length);
    // To the program that opened the page, which writes a recording; where there is none, as numbers.
    if (location.protocol === "http:") {
      const socket = new WebSocket(`ws://${location.host}${location.pathname}socket`);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => socket.send(all.buffer);
      socket.onmessage = (event) => {
        message.textContent = String(event.data);
        socket.close();
      };
      socket.onerror = () => {
        message.textContent = "The program that opened this page has ended: the flight is not saved.";
      };
    } else {
      const names = flight.layout.flatMap(([name, count]) =>
        count === 1 ? [name] : Array.from({ length: count }, (_, k) => `${name}_${k}`),
      );
      const rows = frames.map((frame) => [...frame].join(","));
      save("flight.csv", new Blob([[names.join(","), ...rows, ""].join("\n")], { type: "text/csv" }));
      message.textContent = "Saved as numbers; bodyflight fly writes a recording that every verb reads.";
    }
  }

  function press(event: KeyboardEvent, on: boolean): void {
    const key = event.key.toLowerCase();
    if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    const strength = event.shiftKey ? 0.5 : 1;
    if (on === down.has(key)) return;
    const bound = KEYS.find((entry) => entry.key === key);
    const muscle = MUSCLE.find((entry) => entry[0] === key);
    if (!bound && !muscle) {
      if (!on) return;
      if (key === " " && (event.target as HTMLElement).tagName !== "BUTTON") {
        event.preventDefault();
        pause();
      }
      if (key === "0") begin();
      return;
    }
    if (on) down.add(key);
    else down.delete(key);
    if (bound) core.exports.command(flight.controls.indexOf(bound.control), on ? bound.share * strength : 0);
    if (muscle) {
      const input: [number, number, number] = [0, 0, 0];
      for (const [held, axis, sign] of MUSCLE) if (down.has(held)) input[axis] += sign * MUSCLE_SHARE * strength;
      core.exports.muscle(...input);
    }
  }
  addEventListener("keydown", (event) => press(event, true));
  addEventListener("keyup", (event) => press(event, false));
  addEventListener("blur", () => {
    for (const key of [...down]) press(new KeyboardEvent("keyup", { key }), false);
  });

  let before = performance.now();
  let owed = 0;
  let drawn = 0;
  function next(now: number): void {
    const passed = now - before;
    before = now;
    if (running) {
      // A page in the background does not catch up.
      owed += Math.min(passed, 100) * (RATE / 1000);
      while (owed >= 1) {
        core.exports.step(1);
        owed -= 1;
        if (recorded) recorded.push(core.frame());
      }
    }
    show(passed);
    requestAnimationFrame(next);
  }

  function show(passed: number): void {
    const frame = core.frame();
    stage.draw(core.layout.picture(frame));
    const observation = core.layout.part(frame, "observation");
    const now = frame[0];
    legend.replaceChildren(
      ...[6, 5, 3, 1].map((k) =>
        element("div", {}, `${CHANNELS[k].label}: ${observation[k].toFixed(2)} ${CHANNELS[k].unit}`),
      ),
      element("div", {}, `${now.toFixed(1)} s${recorded ? `, recorded ${(recorded.length / RATE).toFixed(1)} s` : ""}`),
    );
    cost.textContent = `${passed.toFixed(1)} ms from picture to picture, ${stage.cost.toFixed(1)} ms to draw`;
    if (running && (now - drawn > 1 / 30 || now < drawn)) {
      drawn = now;
      time.copyWithin(0, 1);
      time[time.length - 1] = now;
      shown.forEach((k, n) => {
        lines[n].copyWithin(0, 1);
        lines[n][lines[n].length - 1] = observation[k];
      });
      plots.update();
    }
  }

  begin();
  window.bodyflight = { core, flight };
  document.documentElement.dataset.ready = "fly";
  requestAnimationFrame(next);
}

declare global {
  interface Window {
    /** For tests. */
    bodyflight?: { core: Core; flight: FlyData };
  }
}

/** A single joint by hand. */
function joints(core: Core, flight: FlyData): HTMLElement {
  const segment = element(
    "select",
    { "aria-label": "joint" },
    ...flight.shapes.slice(1).map((shape, k) => element("option", { value: String(k + 1) }, shape.name)),
  );
  const sliders = ["psi", "theta", "phi"].map((name, axis) => {
    const slider = element("input", {
      type: "range",
      min: "-1.5",
      max: "1.5",
      step: "0.01",
      value: "0",
      "aria-label": `${name} (rad)`,
    });
    slider.addEventListener("input", () => core.exports.joint(Number(segment.value), axis, Number(slider.value)));
    return element("label", {}, `${name} `, slider);
  });
  return element(
    "section",
    {},
    element("h2", {}, "One joint"),
    element("div", { class: "joints" }, segment, ...sliders),
  );
}

/** Damping by hand: little of it makes a novice. */
function damping(core: Core): HTMLElement {
  const values = ["pitch", "yaw", "roll"].map((name) => {
    const field = element("input", {
      type: "number",
      min: "-1",
      max: "30",
      step: "0.1",
      "aria-label": `damping ${name}`,
      style: "width:5em",
    });
    return { name, field };
  });
  const read = () =>
    core.exports.damping(...(values.map(({ field }) => Number(field.value)) as [number, number, number]));
  core.exports.begin(0);
  const now = core.layout.part(core.frame(), "damping");
  values.forEach(({ field }, k) => {
    field.value = String(Math.round(now[k] * 100) / 100);
    field.addEventListener("change", read);
  });
  return element(
    "section",
    {},
    element("h2", {}, "Damping coefficients"),
    element("div", { class: "joints" }, ...values.map(({ name, field }) => element("label", {}, `${name} `, field))),
  );
}
