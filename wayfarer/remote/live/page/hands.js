// What the hands of a person say: a finger or mouse on the pad, held keys, or a gamepad with a held left shoulder button.
// Each gives [forward, turn] from -1 to 1, turn clockwise; whatever is not held gives nothing. Nothing counts that was held
// before `letGo`: it must be released first, and a gamepad's stick be in its middle.

const DEADZONE = 0.05; // as joy of ROS: sticks do not come back to their exact middle
const LEFT_SHOULDER = 4; // of the standard gamepad
const SLOW = 0.5; // of full deflection: a key has no degrees
const KEYS = {
  ArrowUp: [1, 0], KeyW: [1, 0], ArrowDown: [-1, 0], KeyS: [-1, 0],
  ArrowLeft: [0, -1], KeyA: [0, -1], ArrowRight: [0, 1], KeyD: [0, 1],
};

const hands = { finger: null, keys: new Set(), isFast: false, gamepads: new Set() }; // indices of the gamepads that were let go

// What counts now; null if nothing is held.
function handsNow() {
  return hands.finger?.sample ?? keysNow() ?? gamepadNow();
}

function letGo() {
  hands.finger = null;
  hands.keys.clear();
  hands.gamepads.clear();
}

function keysNow() {
  if (!hands.keys.size) return null;
  const sum = (axis) => Math.max(-1, Math.min(1, [...hands.keys].reduce((total, code) => total + KEYS[code][axis], 0)));
  return [sum(0), sum(1)].map((value) => value * (hands.isFast ? 1 : SLOW));
}

function gamepadNow() {
  for (const gamepad of navigator.getGamepads()) {
    if (!gamepad?.connected) continue;
    const sample = [outside(-gamepad.axes[1]), outside(gamepad.axes[0])];
    const held = gamepad.buttons[LEFT_SHOULDER]?.pressed;
    if (held && hands.gamepads.has(gamepad.index)) return sample;
    if (!held && sample.every((value) => value === 0)) hands.gamepads.add(gamepad.index);
  }
  return null;
}

// A place of a stick without the dead zone around its middle; what is not a number is the middle.
function outside(value) {
  const beyond = (Math.abs(value) - DEADZONE) / (1 - DEADZONE);
  return beyond > 0 ? Math.sign(value) * Math.min(1, beyond) : 0;
}

// Where a finger has been dragged to, from where it touched first: to touch the pad alone drives nowhere.
function dragged({ x, y }, event, radius) {
  const right = (event.clientX - x) / radius, up = (y - event.clientY) / radius;
  const shrunk = Math.max(1, Math.hypot(right, up));
  return [outside(up / shrunk), outside(right / shrunk)];
}

// `counts` tells whether anything may count; `changed` is called at each press and release, which must not wait.
function prepareHands(pad, counts, changed) {
  const drop = () => {
    letGo();
    changed();
  };
  prepareFinger(pad, counts, changed);
  for (const kind of ["keydown", "keyup"]) addEventListener(kind, (event) => (hands.isFast = event.shiftKey));
  addEventListener("keydown", (event) => {
    if (!counts() || !(event.code in KEYS) || event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input")) return;
    event.preventDefault(); // the page must not scroll
    if (event.repeat) return; // it was held before
    hands.keys.add(event.code);
    changed();
  });
  addEventListener("keyup", (event) => hands.keys.delete(event.code) && changed());
  addEventListener("gamepaddisconnected", (event) => hands.gamepads.delete(event.gamepad.index) && changed());
  // After these the browser may never tell of a release.
  for (const kind of ["blur", "resize", "orientationchange"]) addEventListener(kind, drop);
}

// One finger or the mouse; others change nothing until it is gone.
function prepareFinger(pad, counts, changed) {
  pad.addEventListener("pointerdown", (event) => {
    if (!counts() || hands.finger || event.button !== 0) return;
    event.preventDefault();
    pad.setPointerCapture(event.pointerId);
    hands.finger = { id: event.pointerId, x: event.clientX, y: event.clientY, sample: [0, 0] };
    changed();
  });
  pad.addEventListener("pointermove", (event) => {
    if (hands.finger?.id !== event.pointerId) return;
    if (!event.buttons) return release(event); // it was released where the browser did not see it
    hands.finger.sample = dragged(hands.finger, event, reach(pad));
    showKnob(pad, hands.finger.sample);
  });
  const release = (event) => {
    if (hands.finger?.id !== event.pointerId) return;
    hands.finger = null;
    changed();
  };
  for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(kind, release);
  pad.addEventListener("contextmenu", (event) => event.preventDefault()); // of a finger that stays
}

// How many pixels a full deflection is.
const reach = (pad) => pad.clientWidth * 0.375; // the knob, a quarter as wide as the pad, then touches its edge

function showKnob(pad, [forward, turn]) {
  pad.firstElementChild.style.transform = `translate(${turn * reach(pad)}px, ${-forward * reach(pad)}px)`;
}
