// Chooses the viewpoint of the scene: what happens at a moment fills the view, with as little occlusion as possible.

const aim = {
  // Names of the things of interest at a moment: those of a failure, else those of the innermost running step.
  names(time) {
    const about = aboutAt(time), known = new Set((model.map?.outlines ?? []).map((one) => one.name));
    const running = [...nodes.values()].filter((one) => statusAt(one, time) === "running" && one.text).reverse();
    const named = running.map((one) => one.text.split(/[^\p{L}\p{N}_-]+/u).filter((word) => known.has(word)));
    return { about, names: new Set([...about, ...(named.find((words) => words.length) ?? [])]) };
  },
  box(name) {
    const { three } = scene, entity = name === "" ? world.entities.find((one) => one.kind === "link" && one.frame < 0) : world.byName.get(name);
    const group = scene.groups[world.entities.indexOf(entity)];
    return group?.visible ? new three.Box3().setFromObject(group) : null;
  },
  // Bounding boxes of the robot (first), of nearby things of interest, and of the base pose that it drives to.
  subjects(time) {
    const { three } = scene, { near } = model.scene.view, { about, names } = this.names(time);
    scene.root.updateMatrixWorld();
    const robot = this.box(""), boxes = robot ? [robot] : [];
    for (const name of names) {
      const box = this.box(name), size = box?.getSize(new three.Vector3());
      const apart = box && robot ? [0, 1, 2].map((k) => Math.max(0, box.min.getComponent(k) - robot.max.getComponent(k), robot.min.getComponent(k) - box.max.getComponent(k))) : [0];
      if (box && Math.max(size.x, size.y) < 0.7 * scene.extent && (about.has(name) || Math.hypot(...apart) <= near)) boxes.push(box);
    }
    const chosen = questionAt(time, true)?.chosen, r = model.map?.radius;
    if (chosen) boxes.push(new three.Box3(new three.Vector3(chosen[0] - r, chosen[1] - r, 0), new three.Vector3(chosen[0] + r, chosen[1] + r, 0.1)));
    return boxes;
  },
  corners: (box) => Array.from({ length: 8 }, (_, k) => new scene.three.Vector3(...[0, 1, 2].map((axis) => (k >> axis & 1 ? box.max : box.min).getComponent(axis)))),
  // Boxes of other shapes, one per shape, because the box of all walls would occlude the whole room.
  others(subjects) {
    const { three } = scene, found = [];
    world.entities.forEach((entity, k) => {
      if (entity.kind !== "body" || !scene.groups[k].visible) return;
      for (const mesh of scene.groups[k].children) {
        if (!mesh.isMesh) continue;
        const box = new three.Box3().setFromObject(mesh);
        if (!subjects.some((one) => one.containsBox(box))) found.push(box);
      }
    });
    return found;
  },
  // Direction towards the camera from which most of each subject is visible.
  toward(subjects, points) {
    const { three } = scene, { tilts, around, level } = model.scene.view, others = this.others(subjects), ray = new three.Raycaster().ray;
    let best = null;
    tilts.forEach((tilt, steepness) => {
      for (let k = 0; k < around; k++) {
        const turn = ((k + 0.5) * 2 * Math.PI) / around, flat = Math.cos(tilt);
        const toward = new three.Vector3(Math.cos(turn) * flat, Math.sin(turn) * flat, Math.sin(tilt));
        const { eye } = scene.fitted(points, toward), hit = new three.Vector3();
        let worth = -level * steepness;
        for (const box of subjects) {
          const middle = box.getCenter(new three.Vector3());
          const samples = [middle, ...this.corners(box).map((corner) => corner.lerp(middle, 0.3))];
          const seen = samples.filter((point) => {
            ray.origin.copy(eye);
            ray.direction.copy(point).sub(eye).normalize();
            return !others.some((other) => ray.intersectBox(other, hit) && hit.distanceTo(eye) < point.distanceTo(eye) - 0.02);
          });
          worth += 2 * Math.log1p(seen.length);
        }
        if (!best || worth > best.worth + 1e-6) best = { worth, toward };
      }
    });
    return best.toward;
  },
  // Turns the camera to what happens at a moment, or to the whole room if there is no robot.
  at(time) {
    if (!scene.ready) return;
    const subjects = this.subjects(time), points = subjects.flatMap((box) => this.corners(box));
    scene.look(points.length ? { points, toward: this.toward(subjects, points) } : null);
  },
  // With "follow" on, the camera turns to each step that begins.
  follow(time) {
    const step = tree.running()?.id;
    if (step === this.step) return;
    this.step = step;
    if (byId("aim").checked) this.at(time);
  },
};
byId("room").addEventListener("click", () => { byId("aim").checked = false; scene.look(null); });
byId("aim").addEventListener("change", () => { if (byId("aim").checked) aim.at(clock.time); });
clock.onTime((time) => { if (scene.ready && !scene.box.hidden) aim.follow(time); });
