// How numbers and names are written on the page. The server puts PHASES, the texts of the phases, before this.

const MODES = { disarmed: "Disarmed", arming: "Arming: step away", armed: "Armed", manual: "Driven by hand", ended: "Ended" };

// Why a run ends: well, or because somebody asked for it or a limit was reached. Any other reason is a bad one.
const ENDS = { escaped: "good", left_bounds: "good", requested: "plain", signal: "plain", mission_time: "plain", mission_distance: "plain", mission_radius: "plain" };

const known = (value) => value !== null && value !== undefined;
const fixed = (value, digits, unit = "") => (known(value) ? `${value.toFixed(digits)}${unit}` : "–");
const whole = (degrees) => (known(degrees) ? `${((Math.round(degrees) % 360) + 360) % 360}°` : "–");
const signed = (degrees) => (known(degrees) ? `${degrees >= 0.5 ? "+" : ""}${Math.round(degrees) || 0}°` : "–");

function clock(seconds) {
  const whole = Math.floor(seconds);
  const parts = [Math.floor(whole / 60) % 60, whole % 60].map((part) => String(part).padStart(2, "0"));
  const hours = Math.floor(whole / 3600);
  return hours ? `${hours}:${parts.join(":")}` : `${Number(parts[0])}:${parts[1]}`;
}

function ago(seconds) {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  return seconds < 120 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const element = (id) => document.getElementById(id);

// Writes only what has changed: a screen reader speaks, and a selection is lost, at every write.
function write(id, text) {
  const place = element(id);
  if (place.textContent !== text) place.textContent = text;
}
