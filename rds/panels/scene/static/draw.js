// What WebGL draws: solids lit from the camera's side, a height field, and lines whose points have colours.

const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i; // no graphics card

const SOLID_VERTEX = `#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 tint;
uniform mat4 view, model; uniform vec3 color; uniform float tinted; out vec3 world, shade;
void main() { vec4 w = model * vec4(place, 1.0); world = w.xyz; shade = mix(color, tint, tinted); gl_Position = view * w; }`;
const SOLID_FRAGMENT = `#version 300 es
precision highp float; in vec3 world, shade; uniform float alpha; uniform vec3 light; out vec4 seen;
void main() { vec3 n = normalize(cross(dFdx(world), dFdy(world))); float lit = 0.42 + 0.58 * abs(dot(n, light)); seen = vec4(shade * lit, alpha); }`;
const LINE_FRAGMENT = `#version 300 es
precision highp float; in vec3 world, shade; uniform float alpha; uniform vec3 light; out vec4 seen;
void main() { seen = vec4(shade, alpha); }`;

function rgb(hex) { return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255); }

class Painter {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: false });
    if (!gl) throw new Error("this browser has no WebGL");
    this.gl = gl;
    this.canvas = canvas;
    const about = gl.getExtension("WEBGL_debug_renderer_info");
    this.soft = SOFTWARE.test(about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "");
    this.solids = this.program(SOLID_VERTEX, SOLID_FRAGMENT);
    this.strokes = this.program(SOLID_VERTEX, LINE_FRAGMENT);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }
  program(...sources) {
    const gl = this.gl, made = gl.createProgram();
    sources.forEach((source, i) => {
      const shader = gl.createShader(i ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    });
    gl.linkProgram(made);
    const at = (name) => gl.getUniformLocation(made, name);
    return { made, view: at("view"), model: at("model"), color: at("color"), tinted: at("tinted"), alpha: at("alpha"), light: at("light") };
  }
  // points (3 numbers each), triangles or lines between them, and a colour for each where there are tints
  shape(points, indices, tints) {
    const gl = this.gl, made = { array: gl.createVertexArray(), points: gl.createBuffer(), tints: gl.createBuffer(), indices: indices && gl.createBuffer(), count: 0, tinted: !!tints };
    gl.bindVertexArray(made.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, made.points);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, made.tints);
    if (tints) { gl.enableVertexAttribArray(1); gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 0, 0); }
    if (indices) { gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, made.indices); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW); }
    gl.bindVertexArray(null);
    this.change(made, points, tints);
    made.count = indices ? indices.length : points.length / 3;
    return made;
  }
  change(shape, points, tints) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, shape.points);
    gl.bufferData(gl.ARRAY_BUFFER, points, gl.DYNAMIC_DRAW);
    if (tints) { gl.bindBuffer(gl.ARRAY_BUFFER, shape.tints); gl.bufferData(gl.ARRAY_BUFFER, tints, gl.DYNAMIC_DRAW); }
    if (!shape.indices) shape.count = points.length / 3;
  }
  begin(view, back, light) {
    const gl = this.gl;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...back, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const each of [this.solids, this.strokes]) {
      gl.useProgram(each.made);
      gl.uniformMatrix4fv(each.view, true, view);
      gl.uniform3fv(each.light, light);
    }
  }
  draw(shape, model, color, alpha = 1, kind = "solid") {
    const gl = this.gl, program = kind === "solid" ? this.solids : this.strokes;
    if (!shape.count) return;
    gl.useProgram(program.made);
    gl.uniformMatrix4fv(program.model, true, model);
    gl.uniform3fv(program.color, color);
    gl.uniform1f(program.tinted, shape.tinted ? 1 : 0);
    gl.uniform1f(program.alpha, alpha);
    (alpha < 1 ? gl.enable : gl.disable).call(gl, gl.BLEND);
    gl.depthMask(alpha >= 1);
    gl.bindVertexArray(shape.array);
    if (shape.indices) gl.drawElements(gl.TRIANGLES, shape.count, gl.UNSIGNED_INT, 0);
    else gl.drawArrays(gl.LINE_STRIP, 0, shape.count);
    gl.bindVertexArray(null);
    gl.depthMask(true);
  }
}

function boxShape(painter) { // edges of 1 about the origin
  const points = [];
  for (const x of [-0.5, 0.5]) for (const y of [-0.5, 0.5]) for (const z of [-0.5, 0.5]) points.push(x, y, z);
  const faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
  return painter.shape(new Float32Array(points), new Uint32Array(faces.flatMap(([a, b, c, d]) => [a, b, c, a, c, d])));
}
function prismShape(painter, sides = 8) { // radius 1, along z from 0 to 1
  const points = [0, 0, 0, 0, 0, 1], indices = [];
  for (let i = 0; i < sides; i++) {
    const x = Math.cos(2 * Math.PI * i / sides), y = Math.sin(2 * Math.PI * i / sides), j = (i + 1) % sides;
    points.push(x, y, 0, x, y, 1);
    const [a, b, c, d] = [2 + 2 * i, 3 + 2 * i, 2 + 2 * j, 3 + 2 * j];
    indices.push(a, c, d, a, d, b, 0, c, a, 1, b, d);
  }
  return painter.shape(new Float32Array(points), new Uint32Array(indices));
}
function latheShape(painter, rings, sides = 16) { // [radius, z] from below to above, about z
  const points = [], indices = [], [low, high] = [rings[0], rings[rings.length - 1]];
  for (const [r, z] of rings) for (let i = 0; i < sides; i++) points.push(r * Math.cos(2 * Math.PI * i / sides), r * Math.sin(2 * Math.PI * i / sides), z);
  for (let k = 0; k + 1 < rings.length; k++) for (let i = 0; i < sides; i++) {
    const a = k * sides + i, b = k * sides + (i + 1) % sides;
    indices.push(a, b, b + sides, a, b + sides, a + sides);
  }
  [low, high].forEach(([, z], end) => {
    const middle = points.length / 3, from = end ? (rings.length - 1) * sides : 0;
    points.push(0, 0, z);
    for (let i = 0; i < sides; i++) indices.push(middle, from + i, from + (i + 1) % sides);
  });
  return painter.shape(new Float32Array(points), new Uint32Array(indices));
}

// a camera that goes around a point; x to the right, z up. Gives the matrix of the view, and where the light comes from.
function viewFrom(camera, ratio) {
  const { yaw, pitch, far, middle } = camera, back = [Math.cos(pitch) * Math.sin(yaw), -Math.cos(pitch) * Math.cos(yaw), Math.sin(pitch)];
  const right = [Math.cos(yaw), Math.sin(yaw), 0], up = [back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0]];
  const eye = middle.map((value, i) => value + far * back[i]), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const look = [...right, -dot(right, eye), ...up, -dot(up, eye), ...back, -dot(back, eye), 0, 0, 0, 1];
  const lens = 1.9, near = far / 50, end = far * 6;
  const project = [lens / Math.max(ratio, 1), 0, 0, 0, 0, lens * Math.min(ratio, 1), 0, 0, 0, 0, -(end + near) / (end - near), -2 * end * near / (end - near), 0, 0, -1, 0];
  const light = [0, 1, 2].map((i) => 0.55 * back[i] + 0.25 * right[i] + 0.8 * up[i]), long = Math.hypot(...light);
  return { view: product(project, look), light: light.map((value) => value / long) };
}
