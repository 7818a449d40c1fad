// Zoom of the map: by its buttons, by the mouse wheel while Ctrl is held, and by two fingers; a drag moves it. Until then
// everything is shown, and after the buttons the map follows the rover.

const CLOSEST = 16; // times as large as the whole map
const STEP = 1.6; // of a press of a button
const LINE_PX = 16, WHEEL_PX = 240; // a line that the wheel turns; what makes it twice as large

const zoom = { times: 1, middle: null, whole: null, rover: null }; // `middle` is where a person put it; null: at the rover

// The part of the whole map that is looked at.
function zoomed(whole, place, width, height) {
  Object.assign(zoom, { whole, rover: place });
  element("farther").disabled = element("whole").disabled = zoom.times === 1;
  element("closer").disabled = zoom.times === CLOSEST;
  return seenFrom(zoomMiddle(), whole.scale * zoom.times, width, height);
}

function zoomMiddle() {
  return zoom.times === 1 ? zoom.whole.middle : (zoom.middle ?? zoom.rover ?? zoom.whole.middle);
}

function zoomBy(factor) {
  zoom.times = Math.min(CLOSEST, Math.max(1, zoom.times * factor));
  if (zoom.times === 1) zoom.middle = null;
  redraw();
}

// Leaves what is under a place of the canvas where it is.
function zoomAt(canvas, factor, { clientX, clientY }) {
  const { left, top, width, height } = canvas.getBoundingClientRect();
  const [east, north] = zoomMiddle(), before = zoom.times;
  zoomBy(factor);
  if (zoom.times === 1) return;
  const metres = (1 / before - 1 / zoom.times) / zoom.whole.scale; // that a pixel from the middle has moved by
  zoom.middle = [east + (clientX - left - width / 2) * metres, north - (clientY - top - height / 2) * metres];
}

function moveBy(dx, dy) {
  if (zoom.times === 1) return;
  const [east, north] = zoomMiddle(), scale = zoom.whole.scale * zoom.times;
  zoom.middle = [east - dx / scale, north + dy / scale];
  redraw();
}

function prepareMap(canvas) {
  element("closer").onclick = () => zoomBy(STEP);
  element("farther").onclick = () => zoomBy(1 / STEP);
  element("whole").onclick = () => zoomBy(0);
  const turn = (event) => {
    if (!event.ctrlKey || !zoom.whole) return; // the page itself scrolls
    event.preventDefault();
    zoomAt(canvas, 2 ** ((-event.deltaY * (event.deltaMode ? LINE_PX : 1)) / WHEEL_PX), event);
  };
  canvas.addEventListener("wheel", turn, { passive: false });
  canvas.onpointerdown = (event) => event.pointerType === "mouse" && canvas.setPointerCapture(event.pointerId);
  canvas.onpointermove = (event) => canvas.hasPointerCapture(event.pointerId) && moveBy(event.movementX, event.movementY);
  prepareFingers(canvas);
}

// One finger scrolls the page, two are for the map.
function prepareFingers(canvas) {
  let before = null;
  const pinch = (event) => {
    before = event.touches.length === 2 ? fingers(event.touches) : null;
  };
  const move = (event) => {
    if (!before || !zoom.whole || event.touches.length !== 2) return;
    event.preventDefault();
    const now = fingers(event.touches);
    zoomAt(canvas, now.apart / before.apart, now);
    moveBy(now.clientX - before.clientX, now.clientY - before.clientY);
    before = now;
  };
  for (const kind of ["touchstart", "touchend", "touchcancel"]) canvas.addEventListener(kind, pinch, { passive: true });
  canvas.addEventListener("touchmove", move, { passive: false });
}

function fingers([one, other]) {
  const apart = Math.max(1, Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY));
  return { apart, clientX: (one.clientX + other.clientX) / 2, clientY: (one.clientY + other.clientY) / 2 };
}
