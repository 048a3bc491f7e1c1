// Stock as a height field in the work's frame, over the middles of its cells, cut by tools that stand along z: `profile`
// has the heights of a tool's end above its tip, at squared distances that divide radius² evenly. Lengths in mm.

class Stock {
  constructor({ low, high, cell, columns, rows }) {
    Object.assign(this, { low, high, cell, nx: columns, ny: rows });
    this.heights = new Float32Array(this.nx * this.ny).fill(high[2]);
    this.target = null;
    this.indices = this.triangles();
  }
  reset() { this.heights.fill(this.high[2]); }

  // from a to b, of the tool's tip
  cut(a, b, tool, heights = this.heights) {
    const way = Math.hypot(b[0] - a[0], b[1] - a[1]), steps = Math.max(Math.ceil(way / this.cell), 1);
    if (Math.min(a[2], b[2]) >= this.high[2]) return;
    for (let k = 1; k <= steps; k++) this.press(a.map((value, i) => value + (b[i] - value) * k / steps), tool, heights);
  }
  press([x, y, z], { radius: r, profile }, heights) {
    const { cell, nx, ny, low } = this, bottom = low[2], fine = profile.length - 1;
    const i0 = Math.max(Math.ceil((x - r - low[0]) / cell - 0.5), 0), i1 = Math.min(Math.floor((x + r - low[0]) / cell - 0.5), nx - 1);
    const j0 = Math.max(Math.ceil((y - r - low[1]) / cell - 0.5), 0), j1 = Math.min(Math.floor((y + r - low[1]) / cell - 0.5), ny - 1);
    for (let j = j0; j <= j1; j++) for (let i = i0; i <= i1; i++) {
      const off = (low[0] + (i + 0.5) * cell - x) ** 2 + (low[1] + (j + 0.5) * cell - y) ** 2;
      if (off > r * r) continue;
      const share = off / (r * r) * fine, k = Math.min(Math.floor(share), fine - 1), n = j * nx + i;
      const to = Math.max(z + profile[k] + (share - k) * (profile[k + 1] - profile[k]), bottom);
      if (to < heights[n]) heights[n] = to;
    }
  }
  // How far a height is above (+) or below (-) what was intended. A wall that is off by less than a cell is no fault of
  // the depth: heights between those of the neighbours are as intended.
  off(n) {
    const { nx, ny, target } = this, i = n % nx, j = (n - i) / nx, height = this.heights[n];
    let low = Infinity, high = -Infinity;
    for (let v = Math.max(j - 1, 0); v <= Math.min(j + 1, ny - 1); v++) for (let u = Math.max(i - 1, 0); u <= Math.min(i + 1, nx - 1); u++) {
      const each = target[v * nx + u];
      if (each < low) low = each;
      if (each > high) high = each;
    }
    return height > high ? height - high : height < low ? height - low : 0;
  }
  // the heights that were meant
  intend(heights) { this.target = heights.length === this.heights.length ? heights : null; }
  // mm³ that are gone; mm that stand too high and lie too low, at most
  numbers() {
    let gone = 0, over = 0, under = 0;
    this.heights.forEach((height, n) => {
      gone += this.high[2] - height;
      if (this.target) { const off = this.off(n); over = Math.max(over, off); under = Math.max(under, -off); }
    });
    return { gone: gone * this.cell ** 2, over, under };
  }
  // a ring about the field goes down to the stock's bottom
  at(i, j) { return [Math.min(Math.max(i - 1, 0), this.nx - 1), Math.min(Math.max(j - 1, 0), this.ny - 1), i < 1 || j < 1 || i > this.nx || j > this.ny]; }
  triangles() {
    const made = [], wide = this.nx + 2;
    for (let j = 0; j <= this.ny; j++) for (let i = 0; i <= this.nx; i++) {
      const a = j * wide + i;
      made.push(a, a + 1, a + wide + 1, a, a + wide + 1, a + wide);
    }
    return new Uint32Array(made);
  }
  // places and colours; compared: what stands too high is orange, what lies too low is purple
  points(compared, plain) {
    const wide = this.nx + 2, count = wide * (this.ny + 2), places = new Float32Array(3 * count), tints = new Float32Array(3 * count);
    const some = 0.02, high = rgb("#E69F00"), low = rgb("#CC79A7"), right = rgb("#009E73");
    for (let j = 0; j < this.ny + 2; j++) for (let i = 0; i < wide; i++) {
      const [u, v, edge] = this.at(i, j), n = v * this.nx + u, k = 3 * (j * wide + i), height = this.heights[n];
      places[k] = this.low[0] + (u + 0.5) * this.cell; places[k + 1] = this.low[1] + (v + 0.5) * this.cell; places[k + 2] = edge ? this.low[2] : height;
      let tint = plain;
      if (compared && this.target) { const off = this.off(n); tint = off > some ? high : off < -some ? low : this.target[n] < this.high[2] ? right : plain; }
      else if (height < this.high[2]) tint = plain.map((value) => 0.8 * value);
      tints.set(tint, k);
    }
    return [places, tints];
  }
}
