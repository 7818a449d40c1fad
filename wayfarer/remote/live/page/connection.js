// The connection to the rover: it comes back by itself, with growing pauses, and always knows how old its last word is.

const PAUSES_S = [0.5, 1, 2, 4, 8];
const HANGING_S = 10; // a connection that is silent for so long is opened again

class Connection {
  // `take` is given each piece of a message; `token` may be empty.
  constructor(take, token) {
    this.take = take;
    this.token = token;
    this.failures = 0;
    this.heardAt = null;
    this.ended = false;
  }

  get isOpen() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  // Seconds since the last message; null before the first.
  get silentS() {
    return this.heardAt === null ? null : (performance.now() - this.heardAt) / 1000;
  }

  // Seconds until the next attempt.
  get pauseS() {
    return Math.max(0, ((this.againAt ?? 0) - performance.now()) / 1000);
  }

  open() {
    this.drop();
    const socket = new WebSocket(`ws://${location.host}/ws${this.token && `?token=${encodeURIComponent(this.token)}`}`);
    this.socket = socket;
    this.triedAt = performance.now();
    this.seen = 0;
    socket.onmessage = (message) => this.hear(socket, JSON.parse(message.data));
    socket.onclose = () => this.lose();
  }

  // Reopens a connection that hangs; called regularly.
  mind() {
    const since = Math.max(this.triedAt ?? 0, this.heardAt ?? 0);
    if (this.socket && !this.ended && performance.now() - since > HANGING_S * 1000) this.lose();
  }

  send(what) {
    if (this.isOpen) this.socket.send(JSON.stringify(what));
    return this.isOpen;
  }

  hear(socket, pieces) {
    this.failures = 0;
    if (pieces.some((piece) => "state" in piece)) {
      this.heardAt = performance.now();
      this.seen += 1;
      socket.send(JSON.stringify({ seen: this.seen }));
    }
    pieces.forEach(this.take);
  }

  lose() {
    this.drop();
    if (this.ended) return;
    const pauseS = PAUSES_S[Math.min(this.failures, PAUSES_S.length - 1)];
    this.failures += 1;
    this.againAt = performance.now() + pauseS * 1000;
    this.timer = setTimeout(() => this.open(), pauseS * 1000);
  }

  drop() {
    clearTimeout(this.timer);
    if (!this.socket) return;
    this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
    this.socket = null;
  }
}
