// The bins of the last minute in flat arrays: pushed as they come, walked when something is drawn.

export const TRACES = 6; // ex, ey, ez, fx, fy, fz

export class History {
  constructor(capacity) {
    this.capacity = capacity;
    this.count = 0; // ever pushed
    this.t = new Float64Array(capacity);
    this.invalid = new Int32Array(capacity);
    this.doubt = new Int32Array(capacity);
    this.low = new Float64Array(capacity * TRACES);
    this.high = new Float64Array(capacity * TRACES);
    this.sd = new Float64Array(capacity * 3);
  }

  push(bin) {
    const at = this.count++ % this.capacity;
    this.t[at] = bin.t_s;
    this.invalid[at] = bin.invalid;
    this.doubt[at] = bin.doubt;
    for (let k = 0; k < TRACES; k++) {
      this.low[at * TRACES + k] = bin.low[k] ?? NaN;
      this.high[at * TRACES + k] = bin.high[k] ?? NaN;
    }
    for (let k = 0; k < 3; k++) this.sd[at * 3 + k] = bin.sd_um[k] ?? NaN;
  }

  get end() {
    return this.count ? this.t[(this.count - 1) % this.capacity] : NaN;
  }

  // A copy that does not move any more, for the pause.
  copy() {
    const other = new History(this.capacity);
    other.count = this.count;
    for (const name of ["t", "invalid", "doubt", "low", "high", "sd"]) other[name].set(this[name]);
    return other;
  }

  // Groups of bins from `since` on, at most about `most` of them: { t, joined, doubt, invalid,
  // low, high, sd }. `joined` says whether a line may lead here from the group before: never over
  // a gap in time, and never to or from a group with a sample that is not valid.
  groups(since, period, most, span) {
    const width = Math.max(1, Math.ceil(span / period / most)) * period;
    const out = [];
    let open = null;
    let before = -Infinity;
    const first = Math.max(0, this.count - this.capacity);
    let start = this.count;
    while (start > first && this.t[(start - 1) % this.capacity] >= since) start--;
    for (let i = start; i < this.count; i++) {
      const at = i % this.capacity;
      const t = this.t[at];
      const cell = Math.floor(t / width);
      const gap = t - before > 2.5 * period || t < before;
      if (!open || open.cell !== cell || gap) {
        open = {
          cell, t, gap, invalid: 0, doubt: 0, sd: [NaN, NaN, NaN],
          low: new Array(TRACES).fill(NaN), high: new Array(TRACES).fill(NaN),
        };
        out.push(open);
      }
      open.t = t;
      open.invalid += this.invalid[at];
      open.doubt |= this.doubt[at];
      for (let k = 0; k < TRACES; k++) {
        open.low[k] = least(open.low[k], this.low[at * TRACES + k]);
        open.high[k] = most_(open.high[k], this.high[at * TRACES + k]);
      }
      for (let k = 0; k < 3; k++) open.sd[k] = most_(open.sd[k], this.sd[at * 3 + k]);
      before = t;
    }
    for (let i = 0; i < out.length; i++) {
      const last = out[i - 1];
      out[i].joined = i > 0 && !out[i].gap && !out[i].invalid && !last.invalid;
    }
    return out;
  }
}

const least = (a, b) => (Number.isNaN(a) ? b : Number.isNaN(b) ? a : Math.min(a, b));
const most_ = (a, b) => (Number.isNaN(a) ? b : Number.isNaN(b) ? a : Math.max(a, b));
