// Draws the bodies of a run with three.js, all seen by one camera and in one pose.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const BODY = "#7d8797";
  const DEGREE = Math.PI / 180;

  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ alpha: true, antialias: true });
  } catch {
    return; // the flat picture stays
  }
  renderer.shadowMap.enabled = true;

  // --- bodies: each link is a fixed frame with a hinge in it that turns about the joint's axis ---

  function turnOf(numbers) {
    const [a, b, c, d, e, f, g, h, i] = numbers;
    const matrix = new THREE.Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
    return new THREE.Quaternion().setFromRotationMatrix(matrix);
  }

  // Around an axis there are so many sides; twice as many on a body as on its ghosts.
  function geometryOf({ kind, size }, sides) {
    if (kind === "box") return new THREE.BoxGeometry(...size);
    if (kind === "sphere") return new THREE.SphereGeometry(size[0], sides, (2 * sides) / 3);
    if (kind === "capsule") return new THREE.CapsuleGeometry(size[0], size[1], sides / 3, sides).rotateZ(-Math.PI / 2);
    return new THREE.CylinderGeometry(size[0], size[0], size[1], sides).rotateX(Math.PI / 2);
  }

  function materialOf(link, opacity) {
    const clear = opacity < 1;
    return new THREE.MeshStandardMaterial({
      color: link.limb < 0 ? BODY : data.colours[link.limb],
      roughness: 0.65,
      transparent: clear,
      opacity,
      depthWrite: !clear,
    });
  }

  function build(links, opacityOf, sides = 24) {
    const hinges = [];
    links.forEach((link) => {
      const frame = new THREE.Group();
      const hinge = new THREE.Group();
      frame.position.set(...link.place);
      frame.quaternion.copy(turnOf(link.turn));
      frame.add(hinge);
      for (const shape of link.shapes) {
        const mesh = new THREE.Mesh(geometryOf(shape, sides), materialOf(link, opacityOf(link)));
        mesh.position.set(...shape.place);
        mesh.quaternion.copy(turnOf(shape.turn));
        mesh.castShadow = !mesh.material.transparent;
        mesh.receiveShadow = mesh.castShadow;
        hinge.add(mesh);
      }
      if (link.parent >= 0) hinges[link.parent].add(frame);
      hinges.push(hinge);
    });
    const axes = links.map((link) => new THREE.Vector3(...link.axis));
    const pose = (angles) => links.forEach((link, index) => {
      hinges[index].quaternion.setFromAxisAngle(axes[index], link.joint < 0 ? 0 : angles[link.joint]);
    });
    return { root: hinges[0].parent, hinges, pose };
  }

  const GHOST = 0.13;
  const views = data.bodies.map((shown, index) => {
    const scene = new THREE.Scene();
    const stand = new THREE.Group();
    const body = build(shown.links, (link) => 0.3 + 0.7 * link.certainty);
    const samples = shown.samples.map((links) => build(links, (link) => (link.limb < 0 ? 0 : GHOST), 12));
    stand.add(body.root);
    const haze = new THREE.Group();
    samples.forEach((sample) => haze.add(sample.root));
    stand.add(haze);
    scene.add(stand, new THREE.HemisphereLight(0xffffff, 0x8a93a3, 2.2));
    const figure = document.createElement("figure");
    const canvas = document.createElement("canvas");
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${shown.title}: ${shown.note}`);
    const caption = document.createElement("figcaption");
    const title = document.createElement("b");
    title.textContent = shown.title;
    caption.append(title, ` ${shown.note}`);
    figure.append(canvas, caption);
    byId("views").append(figure);
    return { shown, scene, stand, body, samples, haze, canvas, index };
  });

  // --- camera: one for all views ---

  const reach = Math.max(...data.bodies.map((shown, index) => {
    views[index].body.pose(data.joints.map(() => 0));
    const box = new THREE.Box3().setFromObject(views[index].body.root, true);
    return Math.max(box.max.length(), box.min.length());
  }));
  const ground = new THREE.Mesh(
    new THREE.PlaneGeometry(8 * reach, 8 * reach),
    new THREE.ShadowMaterial({ opacity: 0.28 }),
  );
  ground.receiveShadow = true;
  const sun = new THREE.DirectionalLight(0xffffff, 1.7);
  sun.position.set(0.6 * reach, -0.9 * reach, 2.4 * reach);
  sun.castShadow = true;
  sun.shadow.mapSize.set(1024, 1024);
  sun.shadow.bias = -0.002;
  Object.assign(sun.shadow.camera, {
    left: -1.3 * reach, right: 1.3 * reach, top: 1.3 * reach, bottom: -1.3 * reach,
    near: 0.1 * reach, far: 6 * reach,
  });
  const camera = new THREE.PerspectiveCamera(30, 1, reach / 50, reach * 50);
  const target = new THREE.Vector3(0, 0, reach * 0.12);
  camera.up.set(0, 0, 1);
  function lookFrom(azimuth, elevation, distance) {
    camera.position.set(
      distance * Math.cos(elevation) * Math.cos(azimuth),
      distance * Math.cos(elevation) * Math.sin(azimuth),
      distance * Math.sin(elevation),
    ).add(target);
  }
  lookFrom(-32 * DEGREE, 26 * DEGREE, 2.9 * reach);
  const controls = views.map(({ canvas }) => {
    const control = new THREE.OrbitControls(camera, canvas);
    control.target.copy(target);
    control.enablePan = false;
    control.enableZoom = false; // the wheel belongs to the page
    control.maxPolarAngle = 95 * DEGREE;
    control.addEventListener("change", draw);
    return control;
  });
  const grid = new THREE.GridHelper(2 * Math.ceil(reach * 15) / 10, 2 * Math.ceil(reach * 15));
  grid.rotateX(Math.PI / 2);
  grid.material.transparent = true;
  grid.material.opacity = 0.9;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paint = () => {
    grid.geometry.deleteAttribute("color");
    grid.material.vertexColors = false;
    grid.material.color.set(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim());
    grid.material.needsUpdate = true;
  };

  // --- drawing: one renderer for all, copied into each view ---

  let waiting = false;
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      drawNow();
    });
  }
  function drawNow() {
    for (const view of views) {
      const ratio = Math.min(devicePixelRatio, 2);
      const width = Math.round(view.canvas.clientWidth * ratio);
      const height = Math.round(view.canvas.clientHeight * ratio);
      if (!width || !height) continue;
      if (view.canvas.width !== width || view.canvas.height !== height) {
        view.canvas.width = width;
        view.canvas.height = height;
      }
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.fov = camera.aspect < 1 ? 30 / camera.aspect : 30;
      camera.updateProjectionMatrix();
      view.scene.add(grid, ground, sun);
      renderer.render(view.scene, camera);
      const context = view.canvas.getContext("2d");
      context.clearRect(0, 0, width, height);
      context.drawImage(renderer.domElement, 0, 0, width, height);
    }
    const seen = camera.position.clone().sub(target);
    const azimuth = Math.round(Math.atan2(seen.y, seen.x) / DEGREE);
    const elevation = Math.round(Math.asin(seen.z / seen.length()) / DEGREE);
    byId("seen-from").textContent =
      `${Math.abs(azimuth)}° to the ${azimuth < 0 ? "right" : "left"} of ahead, ${elevation}° up`;
  }

  // --- the pose ---

  const driven = data.joints.map((joint, index) => ({ joint, index })).filter(({ joint }) => joint.driven);
  let angles = data.joints.map(() => 0);
  let chosen = -1; // number of an interaction; −1: set by hand

  const sliders = driven.map(({ joint, index }, leg) => {
    const label = document.createElement("label");
    const name = document.createElement("span");
    const swatch = document.createElement("span");
    swatch.className = `swatch swatch-${leg}`;
    name.append(swatch, joint.name);
    const slider = Object.assign(document.createElement("input"), {
      type: "range", min: joint.low, max: joint.high, step: 0.1, value: 0,
    });
    slider.dataset.joint = index;
    const output = document.createElement("output");
    slider.addEventListener("input", () => {
      angles[index] = slider.value * DEGREE;
      chosen = -1;
      show();
    });
    label.append(name, slider, output);
    byId("sliders").append(label);
    return { index, slider, output };
  });

  const buttons = [...data.poses, { label: "All joints at 0", angles: data.joints.map(() => 0) }].map((pose, number) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = pose.label;
    button.addEventListener("click", () => {
      angles = [...pose.angles];
      chosen = number < data.poses.length ? number : -1;
      show();
    });
    byId("poses").append(button);
    return button;
  });

  function place(view) {
    const stood = chosen < 0 ? null : view.shown.stands[chosen];
    if (stood) view.stand.quaternion.copy(turnOf(stood));
    else view.stand.quaternion.identity();
    view.stand.position.set(0, 0, 0);
    view.body.pose(angles);
    view.samples.forEach((sample) => sample.pose(angles));
    view.stand.updateMatrixWorld(true);
    view.stand.position.z = -new THREE.Box3().setFromObject(view.body.root, true).min.z;
    view.stand.updateMatrixWorld(true);
  }

  function show() {
    views.forEach(place);
    sliders.forEach(({ index, slider, output }) => {
      slider.value = angles[index] / DEGREE;
      output.textContent = `${(angles[index] / DEGREE).toFixed(1)}°`;
    });
    buttons.forEach((button, number) => button.setAttribute("aria-pressed", number === chosen));
    byId("pose-says").textContent = chosen < 0
      ? "Posed by hand: the main body is held level, lowest point on the ground."
      : data.poses[chosen].says;
    listEnds();
    draw();
  }

  // --- numbers ---

  const whose = byId("whose");
  const listed = views.filter(({ shown }) => shown.links.some((link) => link.end));
  listed.forEach(({ shown, index }) => whose.append(new Option(shown.title, index)));
  whose.addEventListener("change", listEnds);
  function listEnds() {
    const { shown, body } = views[whose.value || 0];
    const rows = shown.links.flatMap((link, index) => {
      if (!link.end) return [];
      const end = body.root.worldToLocal(body.hinges[index].localToWorld(new THREE.Vector3(...link.end)));
      const row = document.createElement("tr");
      const name = document.createElement("th");
      name.scope = "row";
      name.textContent = link.name;
      row.append(name, ...end.toArray().map((value) => {
        const cell = document.createElement("td");
        cell.textContent = (1000 * value).toFixed(1);
        return cell;
      }));
      return [row];
    });
    byId("ends").tBodies[0].replaceChildren(...rows);
  }

  // --- controls ---

  const look = (azimuth, elevation, distance) => () => {
    lookFrom(azimuth, elevation, distance);
    controls.forEach((control) => control.update());
    draw();
  };
  const zoom = (factor) => () => {
    camera.position.sub(target).multiplyScalar(factor).add(target);
    draw();
  };
  byId("nearer").addEventListener("click", zoom(0.8));
  byId("farther").addEventListener("click", zoom(1.25));
  byId("from-above").addEventListener("click", look(Math.PI, 89 * DEGREE, 4 * reach));
  byId("from-ahead").addEventListener("click", look(0, 12 * DEGREE, 2.9 * reach));
  const STEPS = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, 6], ArrowDown: [0, -6] };
  views.forEach(({ canvas }) => canvas.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    if (!step) return;
    event.preventDefault();
    const seen = camera.position.clone().sub(target);
    const elevation = Math.asin(seen.z / seen.length()) + step[1] * DEGREE;
    const azimuth = Math.atan2(seen.y, seen.x) + step[0] * DEGREE;
    lookFrom(azimuth, Math.min(Math.max(elevation, -5 * DEGREE), 89 * DEGREE), seen.length());
    controls.forEach((control) => control.update());
    draw();
  }));
  const uncertainty = byId("uncertainty");
  if (uncertainty) {
    uncertainty.addEventListener("change", () => {
      views.forEach(({ haze }) => { haze.visible = uncertainty.checked; });
      draw();
    });
  }
  dark.addEventListener("change", () => { paint(); draw(); });
  addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((details) => { details.open = true; });
    drawNow();
  });

  if (byId("flat")) byId("flat").hidden = true;
  byId("stage").hidden = false;
  new ResizeObserver(draw).observe(byId("views"));
  paint();
  if (data.poses.length) buttons[data.poses.length - 1].click();
  else show();
  // Aimed at half the height at which the bodies stand: one that is tall keeps head and feet in view.
  const top = Math.max(...views.map((view) => new THREE.Box3().setFromObject(view.body.root, true).max.z));
  target.z = top / 2;
  controls.forEach((control) => control.target.copy(target));
  look(-32 * DEGREE, (top > reach * 0.8 ? 14 : 30) * DEGREE, 2.9 * reach)();
})();
