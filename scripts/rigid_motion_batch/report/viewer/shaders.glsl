// Each program: its vertex shader, a line of dashes, its fragment shader.

//// solid
layout(location=0) in vec3 p;
layout(location=1) in vec3 n;
layout(location=2) in float tint;
uniform mat4 view, body;
out vec3 N, W;
out float T;
void main() {
  vec4 w = body * vec4(p, 1);
  W = w.xyz;
  N = mat3(body) * n;
  T = tint;
  gl_Position = view * w;
}
----
in vec3 N, W;
in float T;
uniform vec3 colour, eye;
uniform float alpha;
out vec4 o;
void main() {
  vec3 n = normalize(N), e = normalize(eye - W), sun = vec3(.35, -.6, .9);
  if (dot(n, e) < 0.) n = -n;
  float lit = max(dot(n, normalize(sun)), 0.), shine = pow(max(dot(n, normalize(e + sun)), 0.), 40.);
  vec3 base = mix(vec3(.34, .36, .39), colour, T);
  vec3 c = base * (.58 + .15 * n.z + .36 * lit) + .14 * shine + .10 * pow(1. - max(dot(n, e), 0.), 3.);
  o = vec4(c * alpha, alpha);
}

//// line
layout(location=0) in vec4 a;
layout(location=1) in vec4 b;
uniform mat4 view, body;
uniform vec2 size;
uniform float wide, lift;
out float t;
void main() {
  float end = float(gl_VertexID & 1), side = float(gl_VertexID >> 1) * 2. - 1.;
  vec4 A = view * body * vec4(a.xyz, 1), B = view * body * vec4(b.xyz, 1), P = mix(A, B, end);
  vec2 d = (B.xy / B.w - A.xy / A.w) * size;
  d = length(d) > 1e-4 ? normalize(d) : vec2(1, 0);
  t = mix(a.w, b.w, end);
  P.xy += (vec2(-d.y, d.x) * side + d * (end * 2. - 1.) * .3) * wide / size * P.w;
  P.z += lift * P.w;
  gl_Position = P;
}
----
in float t;
uniform vec3 colour, ramp[4];
uniform float alpha, now, trail, faint, top;
out vec4 o;
vec3 heat(float share) {
  float p = clamp(share, 0., 1.) * 3.;
  int i = min(int(p), 2);
  return mix(ramp[i], ramp[i + 1], p - float(i));
}
void main() {
  float a = alpha;
  if (trail > 0.) a *= mix(faint, 1., smoothstep(trail, 0., abs(t - now)));
  o = vec4((top > 0. ? heat(t / top) : colour) * a, a);
}

//// ground
layout(location=0) in vec2 p;
uniform mat4 view;
uniform vec3 centre;
uniform float reach;
out vec2 P, Q;
void main() {
  Q = p;
  P = Q * reach + centre.xy;
  gl_Position = view * vec4(P, centre.z, 1);
}
----
in vec2 P, Q;
uniform vec3 colour;
uniform float cell;
out vec4 o;
void main() {
  vec2 g = P / cell, d = abs(fract(g + .5) - .5) / max(fwidth(g), 1e-5);
  float a = (1. - smoothstep(.1, 1.1, min(d.x, d.y))) * smoothstep(1., .25, length(Q)) * .7;
  o = vec4(colour * a, a);
}

//// dot
layout(location=0) in vec4 a;
uniform mat4 view;
uniform float wide, lift;
out float t;
void main() {
  t = a.w;
  gl_Position = view * vec4(a.xyz, 1);
  gl_Position.z += lift * gl_Position.w;
  gl_PointSize = wide;
}
----
in float t;
uniform vec3 colour, rim;
uniform float now, faint;
out vec4 o;
void main() {
  float r = length(gl_PointCoord - .5) * 2., near = smoothstep(3., .5, abs(t - now));
  float a = smoothstep(1., .8, r) * (faint > .1 ? 1. : near);
  if (a < .01) discard;
  o = vec4(mix(colour, rim, smoothstep(.5, .68, r)) * a, a);
}
