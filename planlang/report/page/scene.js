// The world in three dimensions, redrawn on changes. Without WebGL the map is shown instead.

const scene = {
  box: byId("scene"), groups: [], ghosts: [], ready: false,
  async build() {
    const script = document.createElement("script");
    script.textContent = new TextDecoder().decode(await unpacked("three", "gzip"));
    document.head.append(script);
    const three = globalThis.THREE;
    const probe = document.createElement("canvas");
    if (!(probe.getContext("webgl2"))) throw new Error("this browser has no WebGL");
    this.three = three;
    this.renderer = new three.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio || 1));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = three.PCFShadowMap;
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "The world at the moment of the clock; drag to turn it");
    this.canvas.tabIndex = 0;
    this.box.prepend(this.canvas);
    await this.fill(three);
    this.aim(three);
    new ResizeObserver(() => this.resize()).observe(this.box);
    this.box.addEventListener("wheel", (event) => { this.controls.enableZoom = mayZoom(event, this.canvas); }, { capture: true, passive: true });
    this.canvas.addEventListener("pointerdown", (event) => { this.pressed = [event.clientX, event.clientY]; this.canvas.focus({ preventScroll: true }); });
    this.canvas.addEventListener("click", (event) => {
      const entity = Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]) < 4 && this.under(event)?.object.userData.entity;
      if (entity) legend.pin(legend.nameOf(entity));
    });
    this.canvas.addEventListener("pointermove", (event) => this.point(event));
    this.canvas.addEventListener("pointerleave", () => showTip(""));
    this.canvas.addEventListener("dblclick", (event) => {
      const hit = this.under(event);
      if (hit) { this.isTurned = true; this.controls.target.copy(hit.point); this.controls.update(); }
    });
    this.ready = true;
    legend.build();
    this.recolour();
    this.resize();
    this.move(clock.time);
    aim.at(clock.time);
  },
  async fill(three) {
    this.root = new three.Scene();
    const [x0, y0, x1, y1] = model.scene.bounds, wide = x1 - x0, deep = y1 - y0;
    this.middle = new three.Vector3((x0 + x1) / 2, (y0 + y1) / 2, 0.5);
    this.extent = Math.max(wide, deep);
    this.floor = new three.Mesh(new three.PlaneGeometry(wide, deep), new three.MeshStandardMaterial({ roughness: 0.95 }));
    this.floor.position.set(this.middle.x, this.middle.y, -0.002);
    this.floor.receiveShadow = true;
    this.grid = new three.LineSegments(new three.BufferGeometry(), new three.LineBasicMaterial());
    const lines = [];
    for (let x = Math.ceil(x0); x <= x1; x++) lines.push(x, y0, 0, x, y1, 0);
    for (let y = Math.ceil(y0); y <= y1; y++) lines.push(x0, y, 0, x1, y, 0);
    this.grid.geometry.setAttribute("position", new three.BufferAttribute(new Float32Array(lines), 3));
    this.sky = new three.HemisphereLight(0xffffff, 0xb0b4bd, 1.6);
    this.sky.position.set(0, 0, 1);
    const sun = new three.DirectionalLight(0xffffff, 2.0);
    sun.position.set(this.middle.x - this.extent * 0.35, this.middle.y - this.extent * 0.5, this.extent * 0.95);
    sun.target.position.copy(this.middle);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    sun.shadow.bias = -0.0006;
    sun.shadow.normalBias = 0.012;
    const half = this.extent * 0.62;
    Object.assign(sun.shadow.camera, { left: -half, right: half, top: half, bottom: -half, near: 0.1, far: this.extent * 3 });
    this.root.add(this.floor, this.grid, this.sky, sun, sun.target);
    await this.bodies(three);
  },
  async bodies(three) {
    const geometries = await this.geometries(three), materials = new Map();
    const material = ([r, g, b, a], isGhost) => {
      const key = isGhost ? "ghost" : [r, g, b, a].join();
      if (!materials.has(key)) {
        materials.set(key, isGhost ? new three.MeshBasicMaterial({ transparent: true, opacity: 0.38, depthWrite: false })
          : new three.MeshStandardMaterial({ color: new three.Color().setRGB(r / 255, g / 255, b / 255, three.SRGBColorSpace),
            roughness: 0.72, metalness: 0.02, transparent: a < 255, opacity: a / 255, depthWrite: a > 127 }));
      }
      return materials.get(key);
    };
    const made = (one, isGhost) => {
      const group = new three.Group();
      group.matrixAutoUpdate = false;
      for (const shape of one.shapes) {
        const mesh = new three.Mesh(geometries(shape), material(shape.colour, isGhost));
        if (shape.at) { mesh.position.set(...shape.at.slice(0, 3)); mesh.quaternion.set(...shape.at.slice(3)); }
        if (shape.kind !== "mesh") mesh.scale.set(...shape.size.map((one) => Math.max(one, 1e-4)));
        mesh.castShadow = mesh.receiveShadow = !isGhost;
        const called = legend.nameOf(one);
        mesh.name = isGhost ? `believed: ${one.name}` : one.kind === "link" ? `${called}: ${one.name}` : called;
        mesh.userData.entity = one;
        group.add(mesh);
      }
      return group;
    };
    this.groups = world.entities.map((one) => made(one.kind === "belief" ? { ...world.entities[one.of], name: one.name } : one, one.kind === "belief"));
    world.entities.forEach((one, k) => (one.frame >= 0 ? this.groups[one.frame] : this.root).add(this.groups[k]));
    this.ghostMaterial = materials.get("ghost");
  },
  // Rebuilds the bodies when their number changes: things appear, and beliefs differ from the truth.
  async again() {
    for (const group of this.groups) group.removeFromParent();
    await this.bodies(this.three);
    this.recolour();
  },
  async geometries(three) {
    const cylinder = new three.CylinderGeometry(0.5, 0.5, 1, 32).rotateX(Math.PI / 2);
    const plain = { box: new three.BoxGeometry(1, 1, 1), cylinder, sphere: new three.SphereGeometry(0.5, 32, 16) };
    const meshes = model.scene.meshes.length ? this.meshes(three, await unpacked("meshes", "deflate")) : [];
    return (shape) => (shape.kind === "mesh" ? meshes[shape.mesh] : plain[shape.kind] ?? plain.box);
  },
  meshes(three, buffer) {
    let at = 0;
    return model.scene.meshes.map(({ vertices, triangles, low, size }) => {
      const numbers = new Uint16Array(buffer.slice(at, at + vertices * 6)), points = new Float32Array(vertices * 3);
      at += vertices * 6;
      for (let k = 0; k < vertices; k++) for (let axis = 0; axis < 3; axis++) {
        points[k * 3 + axis] = low[axis] + (size[axis] * numbers[axis * vertices + k]) / 65535;
      }
      const wide = vertices > 65535 ? Uint32Array : Uint16Array;
      const corners = new wide(buffer.slice(at, at + triangles * 3 * wide.BYTES_PER_ELEMENT));
      at += triangles * 3 * wide.BYTES_PER_ELEMENT;
      const made = new three.BufferGeometry();
      made.setAttribute("position", new three.BufferAttribute(points, 3));
      made.setIndex(new three.BufferAttribute(corners, 1));
      made.computeVertexNormals();  // sharp edges stay sharp, because their vertices are duplicated
      return made;
    });
  },
  aim(three) {
    this.camera = new three.PerspectiveCamera(35, 1, 0.05, this.extent * 12);
    this.camera.up.set(0, 0, 1);
    this.controls = new three.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("start", () => { this.isTurned = true; });
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.addEventListener("change", () => this.ask());
  },
  // Position and target of the camera so that points, seen from a direction, fill a panel of any shape.
  fitted(points, toward) {
    const { Box3, Vector3 } = this.three, { border, calm, least } = model.scene.view, right = new Vector3(), up = new Vector3();
    const box = new Box3().setFromPoints(points), target = box.getCenter(new Vector3()), eye = new Vector3();
    const radius = box.getSize(new Vector3()).length() / 2, tall = Math.tan((this.camera.fov * Math.PI) / 360);
    const nearest = Math.max(least / tall, this.view ? calm * radius : 0), seen = new Vector3();
    let away = Math.max(nearest, 3 * radius);
    for (let turn = 0; turn < 8; turn++) {
      this.camera.position.copy(target).addScaledVector(toward, away);
      this.camera.lookAt(target);
      this.camera.updateMatrixWorld();
      let left = Infinity, most = -Infinity, low = Infinity, high = -Infinity;
      for (const point of points) {
        seen.copy(point).project(this.camera);
        left = Math.min(left, seen.x); most = Math.max(most, seen.x); low = Math.min(low, seen.y); high = Math.max(high, seen.y);
      }
      this.camera.matrixWorld.extractBasis(right, up, new Vector3());
      target.addScaledVector(right, ((left + most) / 2) * tall * away * this.camera.aspect).addScaledVector(up, ((low + high) / 2) * tall * away);
      away = Math.max(nearest, away * Math.max(most - left, high - low) / 2 / border);
    }
    return { eye: eye.copy(target).addScaledVector(toward, away), target };
  },
  // Looks at points from a direction, or at the whole room, also after the panel changes its shape.
  look(view) {
    this.view = view;
    this.isTurned = false;
    this.fit();
  },
  fit() {
    const { Vector3 } = this.three, [x0, y0, x1, y1] = model.scene.bounds;
    const corners = () => [x0, x1].flatMap((x) => [y0, y1].flatMap((y) => [-0.1, 1.6].map((z) => new Vector3(x, y, z))));
    const { eye, target } = this.fitted(this.view?.points ?? corners(), this.view?.toward ?? new Vector3(-0.2, -0.72, 0.66).normalize());
    this.camera.position.copy(eye);
    this.controls.target.copy(target);
    this.controls.update();
    this.ask();
  },
  resize() {
    const { clientWidth: wide, clientHeight: high } = this.box;
    if (!this.ready || !wide || !high) return;
    this.renderer.setSize(wide, high, false);
    this.camera.aspect = wide / high;
    this.camera.updateProjectionMatrix();
    if (!this.isTurned) this.fit();
    this.ask();
  },
  recolour() {
    if (!this.ready) return;
    const set = (material, name) => material.color.set(colour(name));
    this.root.background = new this.three.Color(colour("raised"));
    set(this.floor.material, "floor");
    set(this.grid.material, "grid");
    if (this.ghostMaterial) set(this.ghostMaterial, "ghost");
    this.sky.intensity = document.documentElement.classList.contains("dark") ? 1.25 : 1.6;
    this.ask();
  },
  move(time) {
    if (!this.ready) return;
    const ghosts = byId("ghosts").checked, pose = new Float32Array(7), { Vector3, Quaternion } = this.three;
    const place = new Vector3(), turn = new Quaternion(), one = new Vector3(1, 1, 1);
    let differing = 0;
    world.entities.forEach((entity, k) => {
      const found = entity.kind === "belief" ? (ghosts ? ghostAt(entity, time) : null) : poseAt(entity, time, pose);
      const group = this.groups[k];
      group.visible = found !== null;
      if (!found) return;
      differing += entity.kind === "belief";
      group.matrix.compose(place.set(found[0], found[1], found[2]), turn.set(found[3], found[4], found[5], found[6]), one);
      group.matrixWorldNeedsUpdate = true;
    });
    this.box.dataset.time = time.toFixed(2);
    this.box.dataset.ghosts = differing;
    this.places(time);
    this.frames(time);
    legend.named = aim.names(time).names;
    legend.explain(differing, this.question, this.framed.length);
    this.ask();
  },
  // Red frames around the things that are involved in a failure at this moment.
  frames(time) {
    const names = [...aboutAt(time)];
    for (const one of this.framed ?? []) this.root.remove(one);
    this.framed = names.flatMap((name) => {
      const { three } = this, entity = world.byName.get(name), points = [];
      if (!entity) return [];
      this.root.updateMatrixWorld();
      const box = new three.Box3().setFromObject(this.groups[world.entities.indexOf(entity)]).expandByScalar(0.02);
      const at = (k) => [0, 1, 2].map((axis) => (k >> axis & 1 ? box.max : box.min).getComponent(axis));
      for (let k = 0; k < 8; k++) for (const bit of [1, 2, 4]) if (!(k & bit)) points.push(...at(k), ...at(k | bit));
      const lines = new three.LineSegments(new three.BufferGeometry(), new three.LineBasicMaterial({ color: colour("failed") }));
      lines.geometry.setAttribute("position", new three.BufferAttribute(new Float32Array(points), 3));
      this.root.add(lines);
      return [lines];
    });
  },
  // Discs on the floor: candidates for base poses, by reason of rejection, and the chosen one.
  places(time) {
    const question = byId("candidates").checked ? questionAt(time, true) : null;
    if (question === this.question) return;
    this.question = question;
    if (this.discs) { this.root.remove(this.discs); this.discs = null; }
    if (!question) return;
    const { three } = this, group = new three.Group();
    const sides = { square: 4, triangle: 3, diamond: 4, cross: 5, plus: 6 }, r = model.map.radius, ring = new three.RingGeometry(r + 0.03, r + 0.07, 48);
    question.bases.reasons.forEach((reason, number) => {
      const points = question.bases.points.filter((point) => point[0] === number);
      const disc = new three.CircleGeometry(0.04, sides[reasons.get(reason.text).shape] ?? 16);
      const discs = new three.InstancedMesh(disc, new three.MeshBasicMaterial({ color: reason.colour }), points.length);
      points.forEach(([, x, y], k) => discs.setMatrixAt(k, new three.Matrix4().makeTranslation(x, y, 0.012)));
      discs.name = reason.text || "accepted";
      group.add(discs);
    });
    if (question.chosen) {
      const chosen = new three.Mesh(ring, new three.MeshBasicMaterial({ color: colour("done") }));
      chosen.position.set(question.chosen[0], question.chosen[1], 0.014);
      chosen.name = "chosen place";
      group.add(chosen);
    }
    this.discs = group;
    this.root.add(group);
  },
  point(event) {
    showTip(event.buttons ? "" : this.under(event)?.object.name, event.clientX, event.clientY);
  },
  under(event) {
    const { three } = this, box = this.canvas.getBoundingClientRect(), caster = new three.Raycaster();
    caster.setFromCamera(new three.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2), this.camera);
    return caster.intersectObjects(this.root.children).find((one) => one.object.name && one.object.parent.visible);
  },
  ask() {
    if (this.asked || this.box.hidden) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.renderer.render(this.root, this.camera); legend.place(); });
  },
};
clock.onTime((time) => { if (!scene.box.hidden) scene.move(time); });
