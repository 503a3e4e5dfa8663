// The living cell in three dimensions: colored by c, with needles along the flow and its path.

import * as three from "three";
import { colorAt } from "amoeboid/plots";

const NEEDLES = 150;
const DUST = 260;
const BOX = 5;
const MAX_PATH = 4000;
const CLICK = 5; // pixels that a pointer may move between down and up

export class CellView {
  constructor(canvas, { colors, poke }) {
    this.canvas = canvas;
    this.poke = poke;
    this.colors = colors.map((color) => new three.Color(color));
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(32, 4 / 3, 0.1, 60);
    this.camera.position.set(0, 0, 5.4);
    this.turned = new three.Group(); // turned by the user; everything lives in it
    this.turned.quaternion.setFromAxisAngle(new three.Vector3(1, 0, 0), -Math.PI / 2 + 0.35);
    this.scene.add(this.turned, new three.AmbientLight(0xffffff, 2.1), this.camera);
    const light = new three.DirectionalLight(0xffffff, 1.6);
    light.position.set(-1.5, 2.5, 3);
    this.scene.add(light);
    this.geometry = new three.BufferGeometry();
    this.body = new three.Mesh(this.geometry, new three.MeshLambertMaterial({ vertexColors: true }));
    this.needles = new three.InstancedMesh(new three.ConeGeometry(0.022, 1, 7), new three.MeshBasicMaterial({ color: 0x1b1b1b }), NEEDLES);
    this.needles.geometry.translate(0, 0.5, 0);
    this.needles.count = 0;
    this.needles.frustumCulled = false;
    this.track = new three.Line(new three.BufferGeometry(), new three.LineBasicMaterial({ color: 0xd55e00 }));
    this.track.frustumCulled = false;
    this.dust = new three.Points(new three.BufferGeometry(), new three.PointsMaterial({ size: 0.045, color: 0x8a8a8a, transparent: true, opacity: 0.75 }));
    this.dust.frustumCulled = false;
    this.grains = new Float32Array(3 * DUST);
    for (let k = 0; k < DUST; k += 1) {
      const at = (n) => (((k + 0.5) * [0.8191725134, 0.6710436067, 0.5497004779][n]) % 1) * 2 - 1;
      for (let n = 0; n < 3; n += 1) this.grains[3 * k + n] = BOX * at(n);
    }
    this.ring = new three.Mesh(new three.ConeGeometry(0.09, 0.34, 16), new three.MeshBasicMaterial({ color: 0x009e73, transparent: true }));
    this.ring.visible = false;
    this.turned.add(this.body, this.needles, this.track, this.dust, this.ring);
    this.path = [];
    this.listen();
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  restart() {
    this.path = [];
  }

  dark(dark) {
    this.track.material.color.set(dark ? 0xe69f00 : 0xd55e00);
    this.dust.material.color.set(dark ? 0x7f8b95 : 0x8d979f);
    this.draw();
  }

  show(frame, [low, high]) {
    const { x, c, flow, faces } = frame.fields;
    if (faces) {
      this.geometry.setIndex(new three.BufferAttribute(faces, 1));
      this.chosen = null;
    }
    this.geometry.setAttribute("position", new three.BufferAttribute(x, 3));
    const color = new Float32Array(x.length);
    for (let k = 0; k < c.length; k += 1) {
      const found = colorAt(this.colors, (c[k] - low) / (high - low));
      color.set([found.r, found.g, found.b], 3 * k);
    }
    this.geometry.setAttribute("color", new three.BufferAttribute(color, 3));
    this.geometry.computeVertexNormals();
    this.geometry.computeBoundingSphere();
    this.chosen ??= spread(x, Math.min(NEEDLES, c.length));
    this.showFlow(x, flow);
    this.showPath(frame.position);
    this.draw();
  }

  showFlow(x, flow) {
    let fastest = 0;
    for (let k = 0; k < flow.length; k += 3) fastest = Math.max(fastest, Math.hypot(flow[k], flow[k + 1], flow[k + 2]));
    // slow flow, as that of the mesh of a cell at rest, is not blown up
    this.scale = Math.max(this.scale === undefined ? 0 : 0.97 * this.scale, fastest, 0);
    const length = 0.34 / Math.max(this.scale, 1e-12);
    const [item, up, along] = [new three.Object3D(), new three.Vector3(0, 1, 0), new three.Vector3()];
    this.needles.count = this.chosen.length;
    this.chosen.forEach((k, n) => {
      along.set(flow[3 * k], flow[3 * k + 1], flow[3 * k + 2]);
      const size = this.still ? 0 : along.length() * length;
      item.position.set(x[3 * k], x[3 * k + 1], x[3 * k + 2]).multiplyScalar(1.012);
      const thick = Math.max(1e-6, Math.min(1, 0.4 + 2 * size) * Math.min(1, 30 * size)); // no dots where nothing flows
      item.scale.set(thick, Math.max(size, 1e-6), thick);
      if (size > 1e-6) item.quaternion.setFromUnitVectors(up, along.normalize());
      item.updateMatrix();
      this.needles.setMatrixAt(n, item.matrix);
    });
    this.needles.instanceMatrix.needsUpdate = true;
  }

  showPath(position) {
    const last = this.path.at(-1);
    const far = !last || Math.hypot(...position.map((v, n) => v - last[n])) > 0.02;
    if (far) this.path.push(position);
    if (this.path.length > MAX_PATH) this.path = this.path.filter((_, k) => k % 2 === 0);
    const points = new Float32Array(3 * (this.path.length + 1));
    [...this.path, position].forEach((p, k) => points.set(p.map((v, n) => v - position[n]), 3 * k));
    this.track.geometry.setAttribute("position", new three.BufferAttribute(points, 3));
    const around = new Float32Array(3 * DUST);
    for (let k = 0; k < 3 * DUST; k += 1) {
      const v = this.grains[k] - position[k % 3];
      around[k] = v - 2 * BOX * Math.round(v / (2 * BOX));
    }
    this.dust.geometry.setAttribute("position", new three.BufferAttribute(around, 3));
    this.place = position;
  }

  // the path as it is seen now: to the right, and up
  seen() {
    const [right, up] = [this.inside(1, 0), this.inside(0, 1)];
    const along = (p, a) => p[0] * a.x + p[1] * a.y + p[2] * a.z;
    return [...this.path, this.place].map((p) => [along(p, right), along(p, up)]);
  }

  // a direction of the view in the axes of the cell
  inside(right, up, towards = 0) {
    return new three.Vector3(right, up, towards).normalize().applyQuaternion(this.turned.quaternion.clone().invert());
  }

  turn(right, up) {
    const turn = new three.Quaternion();
    this.turned.quaternion.premultiply(turn.setFromAxisAngle(new three.Vector3(0, 1, 0), right));
    this.turned.quaternion.premultiply(turn.setFromAxisAngle(new three.Vector3(1, 0, 0), up));
    this.draw();
  }

  pokeAt(direction) {
    this.ring.position.copy(direction).multiplyScalar(1.28);
    this.ring.quaternion.setFromUnitVectors(new three.Vector3(0, 1, 0), direction.clone().negate());
    this.ring.visible = true;
    clearTimeout(this.fading);
    this.fading = setTimeout(() => { this.ring.visible = false; this.draw(); }, 900);
    this.draw();
    this.poke([direction.x, direction.y, direction.z]);
  }

  hit(event) {
    const box = this.canvas.getBoundingClientRect();
    const at = new three.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    const ray = new three.Raycaster();
    ray.setFromCamera(at, this.camera);
    const [found] = ray.intersectObject(this.body);
    return found ? this.turned.worldToLocal(found.point.clone()).normalize() : null;
  }

  listen() {
    let from = null;
    this.canvas.addEventListener("pointerdown", (event) => {
      from = { x: event.clientX, y: event.clientY, far: false };
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [dx, dy] = [event.clientX - from.x, event.clientY - from.y];
      if (!from.far && Math.hypot(dx, dy) < CLICK) return;
      Object.assign(from, { x: event.clientX, y: event.clientY, far: true });
      this.turn(0.008 * dx, 0.008 * dy);
    });
    this.canvas.addEventListener("pointerup", (event) => {
      const direction = from && !from.far ? this.hit(event) : null;
      from = null;
      if (direction) this.pokeAt(direction);
    });
    this.canvas.addEventListener("pointercancel", () => { from = null; });
    this.canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15] }[event.key];
      if (turns) this.turn(...turns);
      else if (event.key === "Enter") this.pokeAt(this.inside(0, 0, 1));
      else return;
      event.preventDefault();
    });
  }

  draw() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height) return;
    if (this.width !== width || this.height !== height) {
      [this.width, this.height] = [width, height];
      this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
    }
    this.renderer.render(this.scene, this.camera);
  }
}

// nodes that are spread evenly: each is the farthest from those before it
function spread(x, count) {
  const total = x.length / 3;
  const distance = new Float32Array(total).fill(Infinity);
  const chosen = [0];
  while (chosen.length < count) {
    const last = 3 * chosen.at(-1);
    let farthest = 0;
    for (let k = 0; k < total; k += 1) {
      const d = (x[3 * k] - x[last]) ** 2 + (x[3 * k + 1] - x[last + 1]) ** 2 + (x[3 * k + 2] - x[last + 2]) ** 2;
      if (d < distance[k]) distance[k] = d;
      if (distance[k] > distance[farthest]) farthest = k;
    }
    chosen.push(farthest);
  }
  return chosen;
}
