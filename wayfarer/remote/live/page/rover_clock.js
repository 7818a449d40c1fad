// The rover's clock as this page knows it, so that each sample can say when it was taken. A time that the rover sends has
// passed already when it arrives: what comes here is late by what the fastest message of the last seconds took, and
// never ahead. So the rover finds a sample older than it is, not younger. Only a browser that rounds its own clock can
// be wrong by that much: Firefox by up to 0.1 s, if it is set to resist fingerprinting.

const REMEMBERED_S = 10; // in which two clocks drift apart by less than a millisecond

class RoverClock {
  constructor() {
    this.heard = []; // [when, how far the rover's clock was ahead of this browser's, at least], in seconds
  }

  hear(roverS) {
    const nowS = performance.now() / 1000;
    this.heard = this.heard.filter(([atS]) => nowS - atS < REMEMBERED_S);
    this.heard.push([nowS, roverS - nowS]);
  }

  get nowS() {
    return performance.now() / 1000 + Math.max(...this.heard.map(([, aheadS]) => aheadS));
  }
}
