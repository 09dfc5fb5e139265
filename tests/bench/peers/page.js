// page.js - the three.js half: loads the scene of /job.json and times frames along its camera path.
// The driver calls window.prepare() once and window.frames(count) as often as it likes.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';

const job = await (await fetch('/job.json')).json();
const antialias = new URLSearchParams(location.search).has('msaa');
const renderer = new THREE.WebGLRenderer({ antialias, preserveDrawingBuffer: true });
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(job.fov, job.width / job.height, 0.05, 200);

function waitForPixels() {
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

function addSun(target) {
  const sun = new THREE.DirectionalLight(0xffffff, job.sun.lux);
  sun.position.fromArray(job.sun.towards).multiplyScalar(40);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  Object.assign(sun.shadow.camera, { left: -20, right: 20, top: 20, bottom: -20, near: 1, far: 80 });
  sun.shadow.bias = -0.0005;
  sun.shadow.normalBias = 0.02;
  target.add(sun);
}

// Where `helio bench realtime` puts them, and as bright (add_lamps of renderer/bench/realtime.c).
function addLamps(target, bounds) {
  const steps = [0.8191725133961645, 0.6710436067037893, 0.5497004779019703];
  const size = bounds.getSize(new THREE.Vector3());
  const side = Math.max(size.x, size.y, size.z);
  for (let i = 0; i < job.lamps; i++) {
    const lamp = new THREE.PointLight(0xffffff, 20 * side * side / job.lamps);
    lamp.position.fromArray(bounds.min.toArray().map(
      (low, a) => low + size.getComponent(a) * ((0.5 + steps[a] * (i + 1)) % 1)));
    target.add(lamp);
  }
}

window.prepare = async () => {
  renderer.setPixelRatio(1);
  renderer.setSize(job.width, job.height);
  renderer.toneMapping = THREE.ACESFilmicToneMapping;
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;
  document.body.appendChild(renderer.domElement);
  const [gltf, hdr] = await Promise.all([
    new GLTFLoader().loadAsync(job.scene), new HDRLoader().loadAsync(job.env)]);
  hdr.mapping = THREE.EquirectangularReflectionMapping;
  scene.environment = hdr;
  scene.background = hdr;
  gltf.scene.traverse((node) => {
    if (node.isMesh) {
      node.castShadow = true;
      node.receiveShadow = true;
    }
    if (node.isLight) node.visible = false; // the sun is made below, with its shadow
  });
  scene.add(gltf.scene);
  addSun(scene);
  addLamps(scene, new THREE.Box3().setFromObject(gltf.scene));
  await renderer.compileAsync(scene, camera);
  place(0);
  renderer.render(scene, camera);
  waitForPixels();
  renderer.shadowMap.autoUpdate = false; // cached, as ours
  const info = renderer.getContext().getExtension('WEBGL_debug_renderer_info');
  return {
    three: THREE.REVISION,
    samples: renderer.getContext().getParameter(renderer.getContext().SAMPLES),
    device: renderer.getContext().getParameter(info.UNMASKED_RENDERER_WEBGL),
    triangles: renderer.info.render.triangles,
  };
};

function place(index) {
  const pose = job.path[index % job.path.length];
  camera.position.fromArray(pose.eye);
  camera.lookAt(...pose.target);
}

// Milliseconds of each frame of one walk along the path.
window.frames = () => job.path.map((_, i) => {
  const start = performance.now();
  place(i);
  renderer.render(scene, camera);
  waitForPixels();
  return performance.now() - start;
});

// The first pose as a PNG data URL, to check by eye that both draw the same thing.
window.shot = () => {
  place(0);
  renderer.render(scene, camera);
  return renderer.domElement.toDataURL('image/png');
};

window.ready = true;
