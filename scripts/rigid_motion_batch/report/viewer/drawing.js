/* WebGL: solids, lines of any width, dots, the ground. Knows nothing of clips; the shaders are in shaders.glsl. */

export function drawingOn(canvas, shaders, ramp) {
  const gl = canvas.getContext("webgl2", { antialias: true, premultipliedAlpha: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const setters = { [gl.FLOAT]: "uniform1f", [gl.FLOAT_VEC2]: "uniform2fv", [gl.FLOAT_VEC3]: "uniform3fv" };
  const unmoved = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  let size = [1, 1], camera = null;

  function compile([name, sources]) {
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
      const uniform = gl.getActiveUniform(program, i), place = gl.getUniformLocation(program, uniform.name);
      uniforms.push([uniform.name.replace("[0]", ""), place, setters[uniform.type]]);
    }
    return [name, { program, uniforms }];
  }
  const programs = Object.fromEntries(Object.entries(shaders).map(compile));

  /* Numbers that are drawn: attributes of these sizes, a set for each vertex, or for each line. */
  function array(shape, sizes, data, each = 0) {
    const vertices = gl.createVertexArray(), buffer = gl.createBuffer(), stride = sizes.reduce((a, b) => a + b);
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, Float32Array.from(data), gl.STATIC_DRAW);
    sizes.reduce((offset, length, i) => {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, length, gl.FLOAT, false, 4 * stride, 4 * offset);
      gl.vertexAttribDivisor(i, each);
      return offset + length;
    }, 0);
    return { vertices, buffer, shape, each, count: data.length / stride };
  }
  /* Draw with a program: whether it is seen, hides what is behind it, and is hidden by what is before it. */
  function draw(name, { vertices, shape, each, count }, values, { seen = true, hides = false, hidden = true } = {}) {
    const given = { view: camera.view, eye: camera.eye, body: unmoved, ramp, size, alpha: 1, ...values };
    gl.depthMask(hides);
    gl[hidden ? "enable" : "disable"](gl.DEPTH_TEST);
    gl.colorMask(seen, seen, seen, seen);
    gl.polygonOffset(-(values.nearer ?? 0), -(values.nearer ?? 0));
    gl.useProgram(programs[name].program);
    gl.bindVertexArray(vertices);
    for (const [key, place, setter] of programs[name].uniforms)
      if (setter) gl[setter](place, given[key] ?? 0); else gl.uniformMatrix4fv(place, false, given[key]);
    if (each) gl.drawArraysInstanced(shape, 0, 4, count); else gl.drawArrays(shape, 0, count);
  }
  const drop = ({ vertices, buffer }) => [gl.deleteVertexArray(vertices), gl.deleteBuffer(buffer)];
  const segments = (data) => array(gl.TRIANGLE_STRIP, [4, 4], data, 1);
  return {
    draw, drop, segments, triangles: (data) => array(gl.TRIANGLES, [3, 3, 1], data),
    points: (data) => array(gl.POINTS, [4], data), plane: array(gl.TRIANGLE_STRIP, [2], [-1, -1, 1, -1, -1, 1, 1, 1]),
    lines(data, values, how) {
      const once = segments(data);
      draw("line", once, values, how);
      drop(once);
    },
    begin(width, height) {
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      [gl.BLEND, gl.DEPTH_TEST, gl.POLYGON_OFFSET_FILL, gl.SCISSOR_TEST].forEach((one) => gl.enable(one));
      gl.scissor(0, 0, width, height);
      gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthFunc(gl.LEQUAL);
      gl.depthMask(true);
      gl.colorMask(true, true, true, true);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    },
    lane(x, width, through) {
      [size, camera] = [[width, canvas.height], through];
      gl.viewport(x, 0, ...size);
      gl.scissor(x, 0, ...size);
    },
  };
}
