// Driving by hand: the button that asks for the wheels, the samples of the hands that go to the rover, and what ends it.
// Nothing is kept: a page that is loaded again, or connects again, does not drive.

const SAMPLE_MS = 50;
const TIMED = 64; // samples of which is kept when they were sent
const LEASE_S = 2; // the rover itself takes the wheels from a page that is silent for so long

// `state` is "no", "asked" or "drives"; `refused` and `why` are those of the newest answer.
const manual = { state: "no", socket: null, clock: null, deadmanS: 0, beganS: 0, seq: 0, sentAt: [], answeredAt: 0, acceptedAt: 0, delayMs: null, refused: false, why: "" };

function pressDrive() {
  if (manual.state !== "no") return endManual("The rover is not driven from this page any more.");
  if (!isFresh()) return say("Not sent: what the page shows is old.");
  Object.assign(manual, { state: "asked", socket: connection.socket });
  ask({ do: "manual_begin", asked_s: model.state.now_s }, "Drive by hand");
  showManual();
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
  showManual();
}

function takeManual(reply) {
  if (reply.do === "manual_begin" && manual.state === "asked") takeBegin(reply);
  if (reply.do === "manual_drive" && manual.state === "drives") takeDriven(reply);
}

function takeBegin({ ok, why, deadman_s, t_s }) {
  if (!ok) return stopManual(`Not done: ${why}`);
  const now = performance.now();
  Object.assign(manual, { state: "drives", clock: new RoverClock(), deadmanS: deadman_s, beganS: t_s, answeredAt: now, acceptedAt: now, delayMs: null, refused: false, why: "" });
  manual.clock.hear(t_s);
  letGo(); // what was held before does not count
  say("You drive.");
  showManual();
  showPad();
}

function takeDriven({ ok, why, why_not, seq, t_s }) {
  const now = performance.now();
  manual.clock.hear(t_s);
  Object.assign(manual, { answeredAt: now, delayMs: now - manual.sentAt[seq % TIMED], refused: !ok, why: ok ? why_not : why });
  if (ok) manual.acceptedAt = now;
}

function sendSample() {
  if (manual.state !== "drives" || connection.socket !== manual.socket) return;
  const [forward, turn] = handsNow() ?? [0, 0];
  manual.seq += 1;
  manual.sentAt[manual.seq % TIMED] = performance.now();
  connection.send({ do: "manual_drive", seq: manual.seq, forward, turn, sent_s: manual.clock.nowS });
  showKnob(element("pad"), [forward, turn]);
}

// Called regularly.
function sampleHands() {
  const reason = whyToEnd();
  if (reason) return endManual(reason);
  if (manual.state !== "drives") return;
  if (performance.now() - manual.acceptedAt > OLD_S * 1000) letGo(); // it must not drive off again without a new press
  sendSample();
  writeLink();
}

function whyToEnd() {
  if (manual.state === "no") return "";
  if (model.outcome) return "The run has ended.";
  if (connection.socket !== manual.socket || !connection.isOpen) return "Driving has ended: the connection was lost.";
  if (manual.state === "asked") return "";
  // Not t_s: after the beginning a record of something else may come before the first tick, and the mode is a tick's.
  if (model.state.tick_t_s > manual.beganS && model.state.mode !== "manual") return "Driving has ended: the log below says why.";
  return performance.now() - manual.acceptedAt > LEASE_S * 1000 ? `Driving has ended: ${whyStanding() || "the page was too slow"}.` : "";
}

// Why the wheels are stopped, as far as is known here; empty if they are driven.
function whyStanding() {
  const { answeredAt, delayMs, deadmanS, refused, why } = manual, silentS = (performance.now() - answeredAt) / 1000;
  if (silentS > deadmanS) return `no answer for ${ago(silentS)}`;
  const isSlow = refused && delayMs > deadmanS * 1000;
  return isSlow ? `the connection is too slow, what is older than ${deadmanS} s does not count` : why;
}

function writeLink() {
  const why = whyStanding(), delay = manual.delayMs === null ? "" : `, ${Math.round(manual.delayMs)} ms round trip`;
  write("link", `${why ? `The wheels are stopped: ${why}` : "Driving"}${delay}`);
  element("link").className = manual.refused ? "bad caption" : "caption";
}

// Shows the button if the rover may be driven by hand and this page may start wheels, and the pad while it drives.
function showManual() {
  const { about, state, outcome, mayStart } = model;
  const isAllowed = Boolean(about.manual && state && !state.demo && !outcome);
  const drives = manual.state === "drives";
  element("manual").hidden = !isAllowed || !mayStart;
  element("how-to-drive").hidden = !isAllowed || mayStart;
  element("hands").hidden = !drives;
  document.body.classList.toggle("driving", drives);
  write("drive", { no: "Drive by hand", asked: "Asked to drive", drives: "End driving by hand" }[manual.state]);
  element("drive").disabled = manual.state === "no" && !isFresh();
}

// Scrolls to the pad, but Stop never away: on a wide screen it is at the top of the page.
function showPad() {
  if (getComputedStyle(element("controls")).position === "fixed") element("manual").scrollIntoView({ block: "nearest" });
}

function prepareManual() {
  element("drive").onclick = pressDrive;
  prepareHands(element("pad"), () => manual.state === "drives", sendSample);
  document.addEventListener("visibilitychange", () => document.hidden && endManual("Driving has ended: the page was hidden."));
  addEventListener("pagehide", () => endManual(""));
  addEventListener("keydown", (event) => event.code === "Escape" && endManual("The rover is not driven from this page any more."));
  matchMedia("(orientation: portrait)").addEventListener("change", () => manual.state === "drives" && showPad());
  setInterval(sampleHands, SAMPLE_MS);
}
