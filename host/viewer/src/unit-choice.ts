// Choice of the units of speeds, heights and angles.
import { button, element } from "./dom";
import { SPEEDS, type Speed, units } from "./units";

/** The switches; they keep what is chosen. */
export function unitChoice(): HTMLElement {
  const words = (speed: Speed) => (speed === "mph" ? "mph, ft" : speed);
  const speed = element(
    "select",
    { id: "speeds", "aria-label": "unit of speeds", title: "Unit of speeds; with mph, heights are in feet" },
    ...SPEEDS.map((name) => element("option", { value: name }, words(name))),
  );
  speed.value = units.speed;
  speed.addEventListener("change", () => {
    speed.blur();
    units.choose({ speed: speed.value as Speed });
  });
  const angle = button("", "Angles in degrees or in radians", () => units.choose({ degrees: !units.degrees }));
  angle.id = "degrees";
  const name = () => {
    angle.textContent = units.degrees ? "°" : "rad";
  };
  name();
  units.onChoice(name);
  return element("span", { class: "units" }, speed, " ", angle);
}
