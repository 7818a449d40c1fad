// What an algorithm remembers of the wood: its trunks, fainter where it doubts them, and the way that it plans.

const MEMORY_MODES = { plan: "drives by its plan", pledge: "drives by Pledge" };

function drawMemory(pen, view, { trunks, way, mode }, height) {
  pen.strokeStyle = colour("remembered");
  pen.lineCap = pen.lineJoin = "round";
  pen.lineWidth = 5;
  const faintest = Number(colour("faintest"));
  for (const [east0, north0, east1, north1, belief] of trunks) {
    pen.globalAlpha = faintest + (1 - faintest) * belief;
    drawLine(pen, view, [[east0, north0], [east1, north1]]);
  }
  pen.globalAlpha = 1;
  pen.lineWidth = 2.5;
  pen.setLineDash([3, 6]);
  drawLine(pen, view, way);
  pen.setLineDash([]);
  label(pen, MEMORY_MODES[mode] ?? "", 8, height - 10, "left");
}

function drawLine(pen, view, points) {
  pen.beginPath();
  for (const [east, north] of points) pen.lineTo(...view.at(east, north));
  pen.stroke();
}
