// Kinematics as the kernel says them: a chain of fixed matrices with a joint after each but the last. Matrices are 16
// numbers, row by row.

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

function product(a, b) {
  const made = new Array(16);
  for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++) {
    let sum = 0;
    for (let k = 0; k < 4; k++) sum += a[4 * i + k] * b[4 * k + j];
    made[4 * i + j] = sum;
  }
  return made;
}
function shifted(x, y, z) { return [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1]; }
function turnedAbout(along, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), i = (along + 1) % 3, j = (along + 2) % 3, made = [...IDENTITY];
  made[5 * i] = c; made[5 * j] = c; made[4 * i + j] = -s; made[4 * j + i] = s;
  return made;
}
function inverseOf(m) { // of a turn and a shift
  const made = [...IDENTITY];
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) made[4 * i + j] = m[4 * j + i];
    made[4 * i + 3] = -(m[i] * m[3] + m[4 + i] * m[7] + m[8 + i] * m[11]);
  }
  return made;
}
function at(m, p) { return [0, 1, 2].map((i) => m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3]); }

// where a chain ends, for joint values in mm and degrees
function along(chain, values) {
  let made = chain.fixed[0];
  chain.joints.forEach(([number, turns, axis, sign], k) => {
    const value = sign * (values[number] || 0);
    made = product(made, turns ? turnedAbout(axis, value * Math.PI / 180) : shifted(...[0, 1, 2].map((i) => (i === axis ? value : 0))));
    made = product(made, chain.fixed[k + 1]);
  });
  return made;
}
function framesOf(scene, values) {
  return Object.fromEntries(Object.entries(scene.frames).map(([name, chain]) => [name, along(chain, values)]));
}
// where the tip is, seen from the work
function tipOf(scene, values) {
  const tip = along(scene.frames[scene.tip], values);
  return at(inverseOf(along(scene.frames[scene.work], values)), [tip[3], tip[7], tip[11]]);
}
