// Driving by hand: the button that asks for the wheels, the samples of the hands that go to the rover, and what ends it.
// Nothing is kept: a page that is loaded again, or connects again, does not drive.

const SAMPLE_MS = 50; // between two samples where the rover answers at once
const UNANSWERED_MS = 100; // between two where it does not
const TIMED = 64; // samples whose time is kept, for the delay

// `state` is "no", "asked" or "drives"; `told_s` the newest time of the rover in its answers; `delayMs` there and back.
const manual = { state: "no", socket: null, seq: 0, answered: 0, sentAt: [], acceptedAt: 0, toldS: 0, beganS: 0, deadmanS: 0, delayMs: null, why: "" };

function askManual() {
  if (manual.state !== "no") return endManual("The rover is not driven from this page any more.");
  if (!isFresh()) return say("Not sent: what the page shows is old.");
  Object.assign(manual, { state: "asked", socket: connection.socket, delayMs: null, why: "" });
  ask({ do: "manual_begin", state_t_s: model.state.t_s }, "Drive by hand");
  watchManual();
}

function endManual(text) {
  if (manual.state === "no") return;
  if (connection.socket === manual.socket) connection.send({ do: "manual_end" });
  stopManual(text);
}

function stopManual(text) {
  manual.state = "no";
  letGo();
  say(text);
  watchManual();
}

function takeManual(reply) {
  if (reply.do === "manual_begin" && manual.state === "asked") takeBegin(reply);
  if (reply.do !== "manual_drive" || manual.state !== "drives") return;
  const now = performance.now();
  manual.toldS = Math.max(manual.toldS, reply.t_s);
  manual.answered = Math.max(manual.answered, reply.seq);
  manual.delayMs = now - manual.sentAt[reply.seq % TIMED];
  manual.why = reply.ok ? reply.why_not : reply.why;
  if (reply.ok) manual.acceptedAt = now;
}

function takeBegin({ ok, why, deadman_s, t_s }) {
  if (!ok) return stopManual(`Not done: ${why}`);
  Object.assign(manual, { state: "drives", deadmanS: deadman_s, toldS: t_s, beganS: t_s, acceptedAt: performance.now() });
  letGo();
  say("You drive.");
  watchManual();
  element("manual").scrollIntoView({ block: "nearest" });
}

// Sends what the hands say. The rover's newest known time goes with it, so that it can refuse what was under way too long.
function sendSample() {
  if (manual.state !== "drives" || connection.socket !== manual.socket) return;
  const [forward, turn] = handsNow() ?? [0, 0];
  manual.seq += 1;
  manual.sentAt[manual.seq % TIMED] = performance.now();
  connection.send({ do: "manual_drive", seq: manual.seq, forward, turn, state_t_s: Math.max(manual.toldS, model.state.t_s) });
  showKnob(element("pad"), [forward, turn]);
}

// Called regularly.
function sampleHands() {
  if (manual.state === "no") return;
  const reason = whyToEnd();
  if (reason) return endManual(reason);
  const waits = manual.answered < manual.seq && performance.now() - manual.sentAt[manual.seq % TIMED] < UNANSWERED_MS;
  if (!waits) sendSample();
  writeLink();
}

function whyToEnd() {
  if (model.outcome) return "The run has ended.";
  if (connection.socket !== manual.socket || !connection.isOpen) return "Driving ended: the connection was lost. Press Drive by hand to go on.";
  if (manual.state !== "drives") return "";
  if (model.state.t_s > manual.beganS && model.state.mode !== "manual") return "Driving has ended: the log below says why.";
  if (performance.now() - manual.acceptedAt <= OLD_S * 1000) return "";
  return `Driving ended: ${manual.why || "the rover did not answer."}`;
}

// The rover's wheels stand while it takes longer to answer than its deadman allows.
function writeLink() {
  const { delayMs, deadmanS, sentAt, seq, answered } = manual;
  const nowMs = answered < seq ? performance.now() - sentAt[(answered + 1) % TIMED] : 0;
  const worstMs = Math.max(delayMs ?? 0, nowMs);
  const isSlow = worstMs > deadmanS * 1000;
  const why = isSlow ? `the connection takes ${ago(worstMs / 1000)}, ${deadmanS} s is the most` : manual.why;
  const delay = isSlow || delayMs === null ? "" : `, ${Math.round(delayMs)} ms there and back`;
  write("link", `${why ? `The wheels stand: ${why}` : "Driving"}${delay}`);
  element("link").className = isSlow ? "bad caption" : "caption";
}

// Shows the button where the rover may be driven by hand and this page may start wheels, and the pad while it drives.
function watchManual() {
  const { about, state, outcome, mayStart } = model;
  const isAllowed = Boolean(about.manual && state && !state.demo && !outcome);
  element("manual").hidden = !isAllowed || !mayStart;
  element("how-to-drive").hidden = !isAllowed || mayStart;
  element("hands").hidden = manual.state !== "drives";
  document.body.classList.toggle("driving", manual.state === "drives");
  const drive = element("drive");
  write("drive", { no: "Drive by hand", asked: "Asked to drive", drives: "End driving by hand" }[manual.state]);
  drive.disabled = manual.state === "no" && !isFresh();
}

function prepareManual() {
  element("drive").onclick = askManual;
  prepareHands(element("pad"), () => manual.state === "drives", sendSample);
  document.addEventListener("visibilitychange", () => document.hidden && endManual("Driving ended: the page was hidden."));
  addEventListener("pagehide", () => endManual(""));
  addEventListener("keydown", (event) => event.code === "Escape" && endManual("The rover is not driven from this page any more."));
  setInterval(sampleHands, SAMPLE_MS);
}
