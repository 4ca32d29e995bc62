// The shapes of a run through time: WebGL 2, nothing from outside. Without WebGL the pictures in the page stay.
"use strict";
(() => {
  const holder = document.getElementById("viewer");
  if (!holder) return;
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  const canvas = holder.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, preserveDrawingBuffer: true });
  if (!gl) return;
  holder.classList.add("live");

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const bodies = data.bodies.map((body) => ({
    ...body,
    indices: new Uint32Array(bytes(body.indices)),
    shapes: new Int16Array(bytes(body.shapes)), // rest, then every frame
  }));

  const compile = (kind, text) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, "#version 300 es\nprecision highp float;\n" + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  };
  const program = (vertex, fragment) => {
    const made = gl.createProgram();
    gl.attachShader(made, compile(gl.VERTEX_SHADER, vertex));
    gl.attachShader(made, compile(gl.FRAGMENT_SHADER, fragment));
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    return made;
  };
  // positions are whole numbers: mm = low + step * q
  const surface = program(
    `in vec3 now; in vec3 rest; uniform mat4 view; uniform vec3 low; uniform float step_mm; uniform float most;
     out vec3 eye; out float moved;
     void main() {
       vec3 x = low + step_mm * now;
       moved = most > 0.0 ? clamp(length(step_mm * (now - rest)) / most, 0.0, 1.0) : 0.0;
       gl_Position = view * vec4(x, 1.0); eye = gl_Position.xyz;
     }`,
    `in vec3 eye; in float moved; uniform vec4 tint; uniform float coloured; out vec4 colour;
     void main() {
       vec3 n = normalize(cross(dFdx(eye), dFdy(eye)));
       float light = 0.35 + 0.65 * abs(n.z);
       vec3 ramp = mix(mix(vec3(0.87, 0.70, 0.60), vec3(0.99, 0.80, 0.25), smoothstep(0.0, 0.5, moved)), vec3(0.80, 0.15, 0.20), smoothstep(0.4, 1.0, moved));
       colour = vec4(mix(tint.rgb, ramp, coloured) * light, tint.a);
     }`
  );
  const points = program(
    `in vec3 now; uniform mat4 view; uniform float size; void main() { gl_Position = view * vec4(now, 1.0); gl_Position.z -= 0.02; gl_PointSize = size; }`,
    `uniform vec4 tint; uniform float round; out vec4 colour;
     void main() { if (round > 0.5 && length(gl_PointCoord - 0.5) > 0.5) discard; colour = tint; }`
  );

  const buffer = (kind, values) => {
    const made = gl.createBuffer();
    gl.bindBuffer(kind, made);
    gl.bufferData(kind, values, gl.STATIC_DRAW);
    return made;
  };
  for (const body of bodies) {
    body.vertices = buffer(gl.ARRAY_BUFFER, body.shapes);
    body.elements = buffer(gl.ELEMENT_ARRAY_BUFFER, body.indices);
    body.count = body.shapes.length / 3 / (data.times.length + 1);
  }
  const markers = gl.createBuffer();

  let yaw = data.yaw, pitch = data.pitch, zoom = 1, frame = 0, playing = false, asked = false;
  const shown = (name) => holder.querySelector(`[name=${name}]`).checked;

  // columns of a 4 x 4 matrix: turn about the upright axis, tip, fit into the window
  const view = () => {
    const [w, h] = [canvas.width, canvas.height];
    const scale = (1.9 * zoom) / data.size;
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    // rows: right, up, towards the eye, in coordinates (across, up, ahead)
    const right = [cy, 0, -sy], up = [-sp * sy, cp, -sp * cy], near = [cp * sy, sp, cp * cy];
    // blocks stand on z, faces on y
    const own = ([a, u, d]) => (data.up === "z" ? [a, -d, u] : [a, u, d]);
    const fit = [w > h ? h / w : 1, w > h ? 1 : w / h];
    const rows = [[own(right), scale * fit[0]], [own(up), scale * fit[1]], [own(near), -0.9 / data.size]];
    const m = new Float32Array(16);
    rows.forEach(([row, by], i) => {
      row.forEach((c, k) => (m[i + 4 * k] = by * c));
      m[i + 12] = -by * row.reduce((sum, c, k) => sum + c * data.centre[k], 0);
    });
    m[15] = 1;
    return m;
  };

  const draw = () => {
    asked = false;
    const [w, h] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.round(n * devicePixelRatio));
    if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    gl.viewport(0, 0, w, h);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const m = view();
    const at = (made, name) => gl.getUniformLocation(made, name);
    const body = (b, tint, coloured) => {
      gl.useProgram(surface);
      gl.uniformMatrix4fv(at(surface, "view"), false, m);
      gl.uniform3fv(at(surface, "low"), data.low);
      gl.uniform1f(at(surface, "step_mm"), data.step);
      gl.uniform1f(at(surface, "most"), data.most);
      gl.uniform4fv(at(surface, "tint"), tint);
      gl.uniform1f(at(surface, "coloured"), coloured);
      gl.bindBuffer(gl.ARRAY_BUFFER, b.vertices);
      [["now", (frame + 1) * b.count * 6], ["rest", 0]].forEach(([name, offset]) => {
        const location = gl.getAttribLocation(surface, name);
        gl.enableVertexAttribArray(location);
        gl.vertexAttribPointer(location, 3, gl.SHORT, false, 6, offset);
      });
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, b.elements);
      gl.drawElements(gl.TRIANGLES, b.indices.length, gl.UNSIGNED_INT, 0);
    };
    if (shown("muscles"))
      bodies.slice(1).forEach((b) => {
        const part = Math.min(1, b.activation[frame] / data.strongest);
        body(b, [0.35 + 0.55 * part, 0.25 - 0.15 * part, 0.25 - 0.15 * part, 1], 0);
      });
    if (shown("markers") && data.markers.length) {
      const model = [], measured = [], lines = [];
      for (const [a, b] of data.markers[frame]) {
        model.push(...a);
        if (b) { measured.push(...b); lines.push(...a, ...b); }
      }
      gl.useProgram(points);
      gl.uniformMatrix4fv(at(points, "view"), false, m);
      const location = gl.getAttribLocation(points, "now");
      const cloud = (values, kind, tint, size) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, markers);
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.DYNAMIC_DRAW);
        gl.enableVertexAttribArray(location);
        gl.vertexAttribPointer(location, 3, gl.FLOAT, false, 0, 0);
        gl.uniform4fv(at(points, "tint"), tint);
        gl.uniform1f(at(points, "size"), size * devicePixelRatio);
        gl.uniform1f(at(points, "round"), kind === gl.POINTS ? 1 : 0);
        gl.drawArrays(kind, 0, values.length / 3);
      };
      cloud(lines, gl.LINES, [0.85, 0.1, 0.1, 1], 1);
      cloud(model, gl.POINTS, [0, 0.45, 0.7, 1], 8);
      cloud(measured, gl.POINTS, [0, 0, 0, 1], 5);
    }
    if (shown("skin")) {
      const clear = shown("glass");
      if (clear) { gl.enable(gl.BLEND); gl.depthMask(false); }
      body(bodies[0], [0.87, 0.7, 0.6, clear ? 0.45 : 1], 1);
      gl.disable(gl.BLEND);
      gl.depthMask(true);
    }
  };
  const ask = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };

  const slider = holder.querySelector("[name=frame]"), label = holder.querySelector("output");
  const show = (number) => {
    frame = number;
    slider.value = number;
    label.textContent = `frame ${data.frames[number]}, ${data.times[number].toFixed(3)} s`;
    ask();
  };
  slider.max = data.times.length - 1;
  slider.addEventListener("input", () => show(Number(slider.value)));
  holder.querySelectorAll("[type=checkbox]").forEach((box) => box.addEventListener("change", ask));
  const play = holder.querySelector("button");
  play.addEventListener("click", () => {
    playing = !playing;
    play.textContent = playing ? "pause" : "play";
    const start = performance.now(), first = data.times[frame] >= data.times[data.times.length - 1] ? data.times[0] : data.times[frame];
    const tick = (now) => {
      if (!playing) return;
      const time = first + (now - start) / 1000, after = data.times.findIndex((t) => t > time);
      show(after < 0 ? data.times.length - 1 : Math.max(0, after - 1));
      if (after < 0) { playing = false; play.textContent = "play"; } else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  });
  canvas.addEventListener("pointerdown", (down) => {
    canvas.setPointerCapture(down.pointerId);
    let [x, y] = [down.clientX, down.clientY];
    const move = (e) => {
      yaw -= (e.clientX - x) * 0.01;
      pitch = Math.max(-1.5, Math.min(1.5, pitch + (e.clientY - y) * 0.01));
      [x, y] = [e.clientX, e.clientY];
      ask();
    };
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", () => canvas.removeEventListener("pointermove", move), { once: true });
  });
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom *= Math.exp(-e.deltaY * 0.001); ask(); }, { passive: false });
  new ResizeObserver(ask).observe(canvas);
  show(data.first);
})();
