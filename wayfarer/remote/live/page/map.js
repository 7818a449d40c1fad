// The map: the forest of a simulated run, the way so far coloured by phase, what was met, and the rover. North is up.

const LEAST_SPAN_M = 6; // of what is shown: a rover that has not moved yet fills no map
const LEAST_ROVER_PX = 18;

// A canvas in CSS pixels, sharp on any screen.
function sharp(canvas) {
  const { width, height } = canvas.getBoundingClientRect();
  const ratio = devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

function bounds(model) {
  const box = { west: Infinity, east: -Infinity, south: Infinity, north: -Infinity };
  const take = (east, north) => {
    box.west = Math.min(box.west, east);
    box.east = Math.max(box.east, east);
    box.south = Math.min(box.south, north);
    box.north = Math.max(box.north, north);
  };
  for (const [east, north] of model.track) take(east, north);
  if (model.state.place) take(model.state.place[0], model.state.place[1]);
  if (model.forest) {
    for (const [x0, y0, x1, y1] of model.forest.trunks_m) take(x0, y0), take(x1, y1);
    for (const [x, y] of model.forest.trees_m) take(x, y);
    take(model.forest.start_m[0], model.forest.goal_y_m);
  }
  if (box.west > box.east) take(0, 0);
  for (const [low, high] of [["west", "east"], ["south", "north"]]) {
    const lacking = Math.max(0, LEAST_SPAN_M - (box[high] - box[low])) / 2;
    box[low] -= lacking;
    box[high] += lacking;
  }
  return box;
}

// From metres to pixels, with equal axes.
function fit(box, width, height) {
  const margin = 20;
  const scale = Math.min((width - 2 * margin) / (box.east - box.west), (height - 2 * margin) / (box.north - box.south));
  const middleX = (box.west + box.east) / 2, middleY = (box.south + box.north) / 2;
  return seenFrom([middleX, middleY], scale, width, height);
}

// With `middle` in the middle of the canvas, and `scale` pixels per metre.
function seenFrom(middle, scale, width, height) {
  const [east0, north0] = middle;
  return { middle, scale, at: (east, north) => [width / 2 + (east - east0) * scale, height / 2 - (north - north0) * scale] };
}

function drawMap(canvas, model) {
  const { pen, width, height } = sharp(canvas);
  const view = zoomed(fit(bounds(model), width, height), model.state.place, width, height);
  if (model.forest) drawForest(pen, view, model.forest, width);
  drawTrack(pen, view, model.track);
  drawMarks(pen, view, model.marks);
  if (model.state.place) drawRover(pen, view, model.state.place, model.about);
  drawScale(pen, view.scale, width, height);
  const [east, north] = model.state.place || [0, 0];
  canvas.setAttribute("aria-label", `Map, north up: the rover is at ${east.toFixed(0)} m east, ${north.toFixed(0)} m north`);
}

function drawForest(pen, view, forest, width) {
  pen.lineCap = "round";
  pen.strokeStyle = colour("trunk");
  pen.lineWidth = Math.max(2, forest.trunk_diameter_m * view.scale);
  pen.beginPath();
  for (const [x0, y0, x1, y1] of forest.trunks_m) {
    pen.moveTo(...view.at(x0, y0));
    pen.lineTo(...view.at(x1, y1));
  }
  pen.stroke();
  pen.fillStyle = colour("tree");
  for (const [x, y] of forest.trees_m) {
    pen.beginPath();
    pen.arc(...view.at(x, y), Math.max(2, forest.tree_radius_m * view.scale), 0, 2 * Math.PI);
    pen.fill();
  }
  const [, goalY] = view.at(0, forest.goal_y_m);
  pen.strokeStyle = colour("goal-line");
  pen.lineWidth = 2;
  pen.setLineDash([8, 5]);
  pen.beginPath();
  pen.moveTo(0, goalY);
  pen.lineTo(width, goalY);
  pen.stroke();
  pen.setLineDash([]);
  label(pen, "out of the forest", 4, goalY - 5, "left");
  const [startX, startY] = view.at(...forest.start_m);
  pen.strokeStyle = colour("ink");
  pen.lineWidth = 2;
  pen.strokeRect(startX - 4, startY - 4, 8, 8);
}

function drawTrack(pen, view, track) {
  pen.lineCap = pen.lineJoin = "round";
  pen.lineWidth = 2.5;
  for (let first = 1; first < track.length; ) {
    const phase = track[first][2];
    pen.strokeStyle = colour(phase in PHASES ? phase : "halt");
    pen.beginPath();
    pen.moveTo(...view.at(track[first - 1][0], track[first - 1][1]));
    for (; first < track.length && track[first][2] === phase; first += 1) {
      pen.lineTo(...view.at(track[first][0], track[first][1]));
    }
    pen.stroke();
  }
}

function drawMarks(pen, view, marks) {
  const r = view.scale < 10 ? 3 : 4;
  pen.fillStyle = colour("anomaly");
  pen.strokeStyle = colour("mark-edge");
  pen.lineWidth = 1;
  for (const [east, north] of marks) {
    pen.beginPath();
    pen.arc(...view.at(east, north), r, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }
}

// The outline of the body, with a tip at its front; drawn larger than life if it would be too small to see.
function drawRover(pen, view, [east, north, headingDeg], about) {
  const length = Math.max((about.length_m || 0.4) * view.scale, LEAST_ROVER_PX);
  const half = (length * ((about.width_m || 0.4) / (about.length_m || 0.4))) / 2;
  pen.save();
  pen.translate(...view.at(east, north));
  pen.rotate((headingDeg * Math.PI) / 180);
  pen.beginPath();
  pen.moveTo(-half, length / 2);
  pen.lineTo(-half, -length / 4);
  pen.lineTo(0, -length * 0.75);
  pen.lineTo(half, -length / 4);
  pen.lineTo(half, length / 2);
  pen.closePath();
  pen.fillStyle = colour("ink");
  pen.strokeStyle = colour("ground");
  pen.lineWidth = 2;
  pen.fill();
  pen.stroke();
  pen.restore();
}

function drawScale(pen, scale, width, height) {
  const most = Math.min(140, width / 3) / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  const metres = power * [5, 2, 1].find((factor) => factor * power <= most);
  const right = width - 10, left = right - metres * scale, bottom = height - 8;
  pen.strokeStyle = colour("ink");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(left, bottom - 5);
  pen.lineTo(left, bottom);
  pen.lineTo(right, bottom);
  pen.lineTo(right, bottom - 5);
  pen.stroke();
  label(pen, `${metres} m`, (left + right) / 2, bottom - 6, "center");
  const top = bottom - 58;
  pen.beginPath();
  pen.moveTo(right - 10, top);
  pen.lineTo(right - 15, top + 16);
  pen.lineTo(right - 10, top + 12);
  pen.lineTo(right - 5, top + 16);
  pen.closePath();
  pen.fillStyle = colour("ink");
  pen.fill();
  label(pen, "N", right - 10, top - 3, "center");
}

// Text with a rim, so that it can be read over trunks.
function label(pen, text, x, y, align) {
  pen.font = "700 13px system-ui, sans-serif";
  pen.textAlign = align;
  pen.lineWidth = 4;
  pen.strokeStyle = colour("ground");
  pen.strokeText(text, x, y);
  pen.fillStyle = colour("ink");
  pen.fillText(text, x, y);
}
