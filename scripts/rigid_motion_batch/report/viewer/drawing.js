/* WebGL: solids, lines of any width, dots, the ground. Knows nothing of clips; the shaders are in shaders.glsl. */

const UNMOVED = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

export function drawingOn(canvas, shaders, ramp) {
  const gl = canvas.getContext("webgl2", { antialias: true, premultipliedAlpha: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const setters = { [gl.FLOAT]: "uniform1f", [gl.FLOAT_VEC2]: "uniform2fv", [gl.FLOAT_VEC3]: "uniform3fv" };
  let width = 1, height = 1, camera = null, floor = null, programs = {};

  function compile(sources) {
    const program = gl.createProgram(), uniforms = [];
    sources.forEach((source, i) => {
      const shader = gl.createShader(i ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\n${source}`);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    for (let i = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) - 1; i >= 0; i--) {
      const { name, type } = gl.getActiveUniform(program, i);
      uniforms.push([name.replace("[0]", ""), gl.getUniformLocation(program, name), setters[type]]);
    }
    return { program, uniforms };
  }
  function use(name, what, values) {
    const given = { view: camera.view, ramp, ...values };
    gl.useProgram(programs[name].program);
    gl.bindVertexArray(what.vertices);
    for (const [key, place, setter] of programs[name].uniforms)
      if (setter) gl[setter](place, given[key] ?? 0); else gl.uniformMatrix4fv(place, false, given[key]);
  }
  /* Numbers that are drawn: attributes of these sizes, a set for each vertex, or for each of many copies. */
  function array(data, sizes, each = 0) {
    const vertices = gl.createVertexArray(), buffer = gl.createBuffer(), stride = sizes.reduce((a, b) => a + b);
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(data), gl.DYNAMIC_DRAW);
    sizes.reduce((offset, size, i) => {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, gl.FLOAT, false, 4 * stride, 4 * offset);
      gl.vertexAttribDivisor(i, each);
      return offset + size;
    }, 0);
    return { vertices, buffer, count: data.length / stride };
  }
  const drop = (what) => [gl.deleteVertexArray(what.vertices), gl.deleteBuffer(what.buffer)];
  const pen = {
    points: (data) => array(data, [4]), triangles: (data) => array(data, [3, 3, 1]), drop,
    segments: (data) => array(data, [4, 4], 1),
    setUp() {
      programs = Object.fromEntries(Object.entries(shaders).map(([name, sources]) => [name, compile(sources)]));
      floor = array([-1, -1, 1, -1, -1, 1, 1, 1], [2]);
    },
    begin(w, h) {
      if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
      height = h;
      gl.disable(gl.SCISSOR_TEST);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      [gl.BLEND, gl.SCISSOR_TEST, gl.DEPTH_TEST, gl.POLYGON_OFFSET_FILL].forEach((one) => gl.enable(one));
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthFunc(gl.LEQUAL);
    },
    lane(x, wide, seen) {
      [width, camera] = [wide, seen];
      gl.viewport(x, 0, wide, height);
      gl.scissor(x, 0, wide, height);
    },
    ground(colour, centre, reach, cell) {
      gl.depthMask(false);
      use("ground", floor, { colour, centre, reach, cell });
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
      gl.depthMask(true);
    },
    lines(what, colour, wide, alpha, { hidden = true, solid = false, ...more } = {}) {
      gl.depthMask(solid);
      if (!hidden) gl.disable(gl.DEPTH_TEST);
      use("line", what, { colour, width: wide, alpha, body: UNMOVED, size: [width, height], ...more });
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, what.count);
      gl.enable(gl.DEPTH_TEST);
      gl.depthMask(true);
    },
    linesOnce(data, ...how) {
      const once = array(data, [4, 4], 1);
      pen.lines(once, ...how);
      drop(once);
    },
    solid(what, body, colour, alpha = 1, nearer = 0) {
      gl.polygonOffset(-nearer, -nearer);
      use("solid", what, { body, colour, eye: camera.eye, alpha });
      if (alpha < 1) { // its depth first, or its far side would show through
        gl.colorMask(false, false, false, false);
        gl.drawArrays(gl.TRIANGLES, 0, what.count);
        gl.colorMask(true, true, true, true);
      }
      gl.drawArrays(gl.TRIANGLES, 0, what.count);
    },
    dots(what, colour, rim, size, more) {
      use("dot", what, { colour, rim, size, lift: -0.0006, ...more });
      gl.drawArrays(gl.POINTS, 0, what.count);
    },
  };
  pen.setUp();
  return pen;
}
