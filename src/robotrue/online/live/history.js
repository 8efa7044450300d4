// The bins of the last minute in flat arrays: pushed as they come, walked when something is drawn.

export const TRACES = 6; // ex, ey, ez, fx, fy, fz; the joints follow

export class History {
  constructor(capacity, joints = 0) {
    this.capacity = capacity;
    this.joints = joints;
    this.traces = TRACES + joints;
    this.count = 0; // ever pushed
    this.t = new Float64Array(capacity);
    this.invalid = new Int32Array(capacity);
    this.doubt = new Int32Array(capacity);
    this.low = new Float64Array(capacity * this.traces);
    this.high = new Float64Array(capacity * this.traces);
    this.sd = new Float64Array(capacity * 3);
  }

  push(bin) {
    const at = this.count++ % this.capacity;
    this.t[at] = bin.t_s;
    this.invalid[at] = bin.invalid;
    this.doubt[at] = bin.doubt;
    const first = at * this.traces;
    for (let k = 0; k < TRACES; k++) {
      this.low[first + k] = bin.low[k] ?? NaN;
      this.high[first + k] = bin.high[k] ?? NaN;
    }
    for (let k = 0; k < this.joints; k++) {
      this.low[first + TRACES + k] = this.high[first + TRACES + k] = bin.joints_deg[k] ?? NaN;
    }
    for (let k = 0; k < 3; k++) this.sd[at * 3 + k] = bin.sd_um[k] ?? NaN;
  }

  get end() {
    return this.count ? this.t[(this.count - 1) % this.capacity] : NaN;
  }

  // A copy that does not move any more, for the pause.
  copy() {
    const other = new History(this.capacity, this.joints);
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
          low: new Array(this.traces).fill(NaN), high: new Array(this.traces).fill(NaN),
        };
        out.push(open);
      }
      open.t = t;
      open.invalid += this.invalid[at];
      open.doubt |= this.doubt[at];
      for (let k = 0; k < this.traces; k++) {
        open.low[k] = least(open.low[k], this.low[at * this.traces + k]);
        open.high[k] = most_(open.high[k], this.high[at * this.traces + k]);
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
