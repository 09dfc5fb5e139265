// peers.mjs - Heliograph and three.js, the same scene, camera path, size, sun and environment.
//
//   npm ci && node peers.mjs --helio build/bin/helio [--scene FILE] [--env FILE]
//       [--gl llvmpipe|swiftshader|both|none] [--size 1280x720] [--rounds 3] [--json FILE] [--shots FOLDER]
//       [--msaa no|yes|both] [--poses 8] [--lamps N] [--bench JSON] [--first yes|no]
//
// The walks alternate in one run, so that what else the machine does meets both. Printed: the
// median frame time of each, processor time of a frame (of all processes, least of the rounds: on a busy machine
// ratios of that say more), ratios, and the time from start to the first picture.
// Both draw every frame in full: shaded, shadowed by a cached shadow map, and read back. --bench: more options of
// `helio bench realtime` ('{"gi":1,"reflections":1,"temporal":1,"scale":67}' is all that there is); --lamps: of both,
// without shadows there.
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import { execFileSync } from 'node:child_process';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));
const data = process.env.HELIO_TEST_DATA ?? path.join(here, '../../../../shared/data');

const backends = {
  swiftshader: { args: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'], env: {} },
  llvmpipe: {
    args: ['--use-gl=angle', '--use-angle=gl-egl', '--ignore-gpu-blocklist'],
    env: { LIBGL_ALWAYS_SOFTWARE: '1', EGL_PLATFORM: 'surfaceless' },
  },
};

function parse(argv) {
  const options = {
    helio: path.join(here, '../../../build/bin/helio'),
    scene: path.join(data, 'scenes/Sponza/glTF/Sponza.gltf'),
    env: path.join(data, 'hdr/royal_esplanade_1k.hdr'),
    gl: 'llvmpipe', size: '1280x720', rounds: '3', json: '', poses: '8', shots: '', msaa: 'no', lamps: '0',
    bench: '{}', first: 'yes',
  };
  for (let i = 2; i < argv.length; i += 2) {
    const name = argv[i].replace(/^--/, '');
    if (!(name in options) || argv[i + 1] === undefined) {
      console.error(`unknown or incomplete option ${argv[i]}; see the head of peers.mjs`);
      process.exit(2);
    }
    options[name] = argv[i + 1];
  }
  if (!['no', 'yes', 'both'].includes(options.msaa)) {
    console.error('--msaa is no, yes or both');
    process.exit(2);
  }
  for (const file of [options.helio, options.scene, options.env]) {
    if (!fs.existsSync(file)) {
      console.error(`${file} is missing`);
      process.exit(1);
    }
  }
  return options;
}

// A walk through the nave of Sponza, eye and target in metres.
function makePath(count) {
  const poses = [];
  for (let i = 0; i < count; i++) {
    const t = i / count;
    const turn = 0.6 * Math.sin(2 * Math.PI * t);
    const eye = [6 - 12 * t, 1.6 + t, 0.4 * Math.sin(6 * t)];
    poses.push({ eye, target: [eye[0] - Math.cos(turn), eye[1] + 0.1, eye[2] + Math.sin(turn)] });
  }
  return poses;
}

const sun = { towards: [0.25, 0.93, 0.27], lux: 3 };

// Quaternion that turns -Z (where a glTF light shines) to `direction`.
function turnFromMinusZ(direction) {
  const n = Math.hypot(...direction);
  const [x, y, z] = direction.map((v) => v / n);
  const q = [y, -x, 0, 1 - z]; // cross(-Z, d), 1 + dot(-Z, d)
  const m = Math.hypot(...q);
  return q.map((v) => v / m);
}

// The scene with the sun in it, beside links to the files it names.
function withSun(file, folder) {
  const source = path.dirname(path.resolve(file));
  for (const name of fs.readdirSync(source))
    fs.symlinkSync(path.join(source, name), path.join(folder, name));
  const gltf = JSON.parse(fs.readFileSync(file, 'utf8'));
  const light = { type: 'directional', intensity: sun.lux, color: [1, 1, 1] };
  gltf.extensionsUsed = [...new Set([...(gltf.extensionsUsed ?? []), 'KHR_lights_punctual'])];
  gltf.extensions = { ...gltf.extensions, KHR_lights_punctual: { lights: [light] } };
  gltf.nodes.push({
    name: 'sun', rotation: turnFromMinusZ(sun.towards.map((v) => -v)),
    extensions: { KHR_lights_punctual: { light: 0 } },
  });
  gltf.scenes[gltf.scene ?? 0].nodes.push(gltf.nodes.length - 1);
  const out = path.join(folder, 'with-sun.gltf');
  fs.writeFileSync(out, JSON.stringify(gltf));
  return out;
}

const types = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json' };

// Serves the page, three.js, the job and the scene's folder on the loopback interface.
function serve(job, scene, env) {
  const roots = { three: path.join(here, 'node_modules/three'), scene: path.dirname(scene) };
  const answer = (request, response) => {
    const url = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
    const [, first, ...rest] = url.split('/');
    let body;
    try {
      if (url === '/job.json') body = JSON.stringify(job);
      else if (url === '/env.hdr') body = fs.readFileSync(env);
      else if (roots[first]) body = fs.readFileSync(path.join(roots[first], ...rest));
      else body = fs.readFileSync(path.join(here, path.basename(url)));
    } catch {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, { 'content-type': types[path.extname(url)] ?? 'application/octet-stream' });
    response.end(body);
  };
  return new Promise((done) => {
    const server = http.createServer(answer).listen(0, '127.0.0.1', () => done(server));
  });
}

// Processor time of a process and all that it started, ms.
function processorTime(root) {
  const parents = new Map(), ticks = new Map();
  for (const pid of fs.readdirSync('/proc').filter((name) => /^[0-9]+$/.test(name))) {
    try {
      const fields = fs.readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ').pop().split(' ');
      parents.set(Number(pid), Number(fields[1]));
      ticks.set(Number(pid), Number(fields[11]) + Number(fields[12]));
    } catch { /* it ended meanwhile */ }
  }
  const belongs = (pid) => pid === root || (parents.has(pid) && belongs(parents.get(pid)));
  return [...ticks].filter(([pid]) => belongs(pid)).reduce((sum, [, n]) => sum + 10 * n, 0);
}

async function startThree(backend, port, msaa) {
  const puppeteer = (await import('puppeteer-core')).default;
  const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true,
    args: ['--no-sandbox', '--disable-dev-shm-usage', ...backends[backend].args],
    env: { ...process.env, ...backends[backend].env }, protocolTimeout: 600000,
  });
  const started = performance.now();
  const page = await browser.newPage();
  page.on('pageerror', (error) => console.error(`${backend}: ${error.message}`));
  await page.goto(`http://127.0.0.1:${port}/page.html${msaa ? '?msaa' : ''}`);
  await page.waitForFunction('window.ready', { timeout: 60000 });
  const about = await page.evaluate(() => window.prepare());
  about.first_picture_s = (performance.now() - started) / 1000;
  return {
    about,
    walk: async () => {
      const before = processorTime(browser.process().pid);
      const frames_ms = await page.evaluate(() => window.frames());
      return { frames_ms, cpu_ms: (processorTime(browser.process().pid) - before) / frames_ms.length };
    },
    shot: async (file) => fs.writeFileSync(file, Buffer.from(
      (await page.evaluate(() => window.shot())).split(',')[1], 'base64')),
    close: () => browser.close(),
  };
}

// One walk of ours along the same path, in a worker of its own; milliseconds of each frame.
function walkOurs(options, scene, job, folder) {
  const out = path.join(folder, 'helio.json');
  const request = { scene, environment: path.resolve(options.env), width: job.width,
    height: job.height, vfov_deg: job.fov, rounds: 1, path: job.path, lamps: job.lamps,
    ...JSON.parse(options.bench) };
  execFileSync(options.helio, ['bench', 'realtime', '--options', JSON.stringify(request),
    ...assetRoots(options, folder), '--json', out, '--progress', 'none'],
  { stdio: ['ignore', 'ignore', 'inherit'] });
  return JSON.parse(fs.readFileSync(out, 'utf8'));
}

function assetRoots(options, folder) {
  const folders = [folder, ...[options.scene, options.env].map((f) => path.dirname(path.resolve(f)))];
  return folders.flatMap((f) => ['--asset-root', fs.realpathSync(f)]);
}

function firstPictureOurs(options, scene, job, folder, cache) {
  const started = performance.now(), pose = job.path[0];
  execFileSync(options.helio, ['render', scene, '-o', path.join(folder, 'first.png'),
    '--size', options.size, '--env', options.env, '--exposure', '0', '--fov', String(job.fov), '--spp', '1',
    `--eye=${pose.eye}`, `--target=${pose.target}`, '--progress', 'none',
    ...assetRoots(options, folder)],
  { stdio: ['ignore', 'ignore', 'ignore'], env: { ...process.env, XDG_CACHE_HOME: cache } });
  return (performance.now() - started) / 1000;
}

function median(values) {
  const sorted = [...values].sort((a, b) => a - b), middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

async function main() {
  const options = parse(process.argv);
  const [width, height] = options.size.split('x').map(Number);
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), 'helio-peers-'));
  const scene = withSun(options.scene, folder);
  const job = { width, height, fov: 45, sun, path: makePath(Number(options.poses)),
    lamps: Number(options.lamps), scene: `/scene/${path.basename(scene)}`, env: '/env.hdr' };
  const server = await serve(job, scene, options.env);
  const drivers = { both: ['llvmpipe', 'swiftshader'], none: [] }[options.gl] ?? [options.gl];
  const samples = { both: [false, true], yes: [true], no: [false] }[options.msaa];
  const peers = drivers.flatMap((driver) => samples.map((msaa) => (
    { driver, msaa, name: msaa ? `${driver}, MSAA` : driver })));
  const wanted = peers.map((peer) => peer.name);
  const result = { size: options.size, rounds: Number(options.rounds), peers: {}, ours: {} };
  const cache = path.join(folder, 'cache');
  const ours = [], theirs = {};
  try {
    if (options.first === 'yes') {
      result.ours.first_picture_cold_s = firstPictureOurs(options, scene, job, folder, cache);
      result.ours.first_picture_warm_s = firstPictureOurs(options, scene, job, folder, cache);
    }
    const running = {};
    for (const { name, driver, msaa } of peers) {
      running[name] = await startThree(driver, server.address().port, msaa);
      result.peers[name] = running[name].about;
      theirs[name] = [];
      await running[name].walk(); // warm-up
    }
    for (let round = 0; round < result.rounds; round++) {
      const walk = walkOurs(options, scene, job, folder);
      ours.push(...walk.frames_ms);
      result.ours.cpu_ms = Math.min(walk.cpu_ms, result.ours.cpu_ms ?? Infinity);
      for (const name of wanted) {
        const { frames_ms, cpu_ms } = await running[name].walk(), peer = result.peers[name];
        theirs[name].push(...frames_ms);
        peer.cpu_ms = Math.min(cpu_ms, peer.cpu_ms ?? Infinity);
      }
    }
    for (const name of wanted) {
      if (options.shots) await running[name].shot(path.join(options.shots, `${name}.png`));
      await running[name].close();
    }
    if (options.shots && options.first === 'yes')
      fs.copyFileSync(path.join(folder, 'first.png'), path.join(options.shots, 'heliograph.png'));
  } finally {
    server.close();
    fs.rmSync(folder, { recursive: true, force: true });
  }
  result.ours.frame_ms = median(ours);
  const times = (r) => `${r.frame_ms.toFixed(1)} ms per frame (${r.cpu_ms.toFixed(0)} of processor time)`;
  const first = (r) => 'first_picture_cold_s' in r
    ? `, first picture ${r.first_picture_cold_s.toFixed(1)} s cold, ${r.first_picture_warm_s.toFixed(1)} s warm` : '';
  console.log(`Heliograph: ${times(result.ours)}${first(result.ours)}`);
  for (const name of wanted) {
    const peer = result.peers[name];
    peer.frame_ms = median(theirs[name]);
    peer.ratio = peer.frame_ms / result.ours.frame_ms;
    peer.cpu_ratio = peer.cpu_ms / result.ours.cpu_ms;
    console.log(`three.js r${peer.three}${peer.samples > 0 ? `, MSAA ${peer.samples}x` : ''} on ${peer.device}: ` +
      `${times(peer)}, first picture ${peer.first_picture_s.toFixed(1)} s; ratio ${peer.ratio.toFixed(2)} ` +
      `(${peer.cpu_ratio.toFixed(2)} of processor time)`);
  }
  if (options.json) fs.writeFileSync(options.json, `${JSON.stringify(result, null, 1)}\n`);
}

await main();
