// orbit.js - three.js behind a remote desktop: the place of the pointer turns the camera about the scene's middle.
// One picture for each movement; POST /ready when the first is drawn.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const renderer = new THREE.WebGLRenderer({ antialias: false });
renderer.setPixelRatio(1);
renderer.setSize(innerWidth, innerHeight);
renderer.shadowMap.enabled = true;
document.body.appendChild(renderer.domElement);

const scene = new THREE.Scene();
const gltf = await new GLTFLoader().loadAsync(new URLSearchParams(location.search).get('scene'));
gltf.scene.traverse((node) => {
  if (node.isMesh) node.castShadow = node.receiveShadow = true;
});
const bounds = new THREE.Box3().setFromObject(gltf.scene);
const middle = bounds.getCenter(new THREE.Vector3()), radius = bounds.getSize(new THREE.Vector3()).length();
scene.add(gltf.scene, new THREE.HemisphereLight(0xffffff, 0x404040, 2));
const sun = new THREE.DirectionalLight(0xffffff, 3);
sun.position.copy(middle).add(new THREE.Vector3(0.25, 0.93, 0.27).multiplyScalar(radius));
sun.target.position.copy(middle);
sun.castShadow = true;
sun.shadow.mapSize.set(2048, 2048);
Object.assign(sun.shadow.camera, { left: -radius, right: radius, top: radius, bottom: -radius, far: 3 * radius });
scene.add(sun, sun.target);

const camera = new THREE.PerspectiveCamera(45, innerWidth / innerHeight, radius / 1000, 10 * radius);
function draw(x) {
  const angle = 2 * Math.PI * x / innerWidth;
  camera.position.set(middle.x + radius * Math.sin(angle), middle.y, middle.z + radius * Math.cos(angle));
  camera.lookAt(middle);
  renderer.render(scene, camera);
  renderer.shadowMap.autoUpdate = false;
}

let asked = false, at = 0;
addEventListener('pointermove', (event) => {
  at = event.clientX;
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => {
    asked = false;
    draw(at);
  });
});
await renderer.compileAsync(scene, camera);
draw(0);
await fetch('/ready', { method: 'POST' });
