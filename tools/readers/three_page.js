// What three.js makes of a file: loads it as any page would, counts what it got and draws it through a given camera.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MTLLoader } from 'three/addons/loaders/MTLLoader.js';
import { OBJLoader } from 'three/addons/loaders/OBJLoader.js';
import { USDLoader } from 'three/addons/loaders/USDLoader.js';
import { withLevels } from '/three_levels.js';

// Loads a file by its suffix: of a GLB the finest level of detail, as any page gets it, the one asked for (one
// tree), or all of them, for a camera to choose from.
async function load(url, level, camera) {
  const suffix = url.split('.').pop().toLowerCase();
  if (suffix === 'glb') {
    const gltf = await new GLTFLoader().loadAsync(url);
    if (camera.isPerspectiveCamera) return withLevels(gltf, camera.fov);
    return level ? (await withLevels(gltf, 50)).children[0].levels[level].object : gltf.scene;
  }
  if (suffix === 'obj') {
    const materials = await new MTLLoader().loadAsync(url.replace(/obj$/, 'mtl'));
    materials.preload();
    const model = await new OBJLoader().setMaterials(materials).loadAsync(url);
    await pictures(model);
    return cutOut(bothSides(model)); // MTL can say neither
  }
  return bothSides(await new USDLoader().loadAsync(url)); // it ignores doubleSided
}

function bothSides(model) {
  model.traverse((one) => [one.material ?? []].flat().forEach((m) => { m.side = THREE.DoubleSide; }));
  return model;
}

// With map_d MTLLoader blends, and what is transparent would hide the leaves behind it.
function cutOut(model) {
  model.traverse((one) => [one.material ?? []].flat().forEach((m) => {
    if (m.alphaMap) Object.assign(m, { transparent: false, alphaTest: 0.5 });
  }));
  return model;
}

// MTLLoader does not wait for its pictures.
async function pictures(model) {
  const maps = new Set();
  model.traverse((one) => [one.material ?? []].flat().forEach((m) => [m.map, m.alphaMap].forEach((t) => t && maps.add(t))));
  for (const map of maps) while (!map.image?.complete) await new Promise((done) => setTimeout(done, 10));
}

// The camera of forestgen's own pictures, whose rows of `axes` are its right, its up and where it stands;
// or one in perspective.
function cameraOf({ size, root_px, px_per_metre, axes, fov, position, target }) {
  const [width, height] = size;
  if (fov) {
    const camera = new THREE.PerspectiveCamera(fov, width / height, 0.1, 5000);
    camera.position.set(...position);
    camera.lookAt(...target);
    camera.updateMatrixWorld();
    return camera;
  }
  const [x, y] = root_px;
  const camera = new THREE.OrthographicCamera(
    -x / px_per_metre, (width - x) / px_per_metre, y / px_per_metre, (y - height) / px_per_metre, -1000, 1000);
  const [right, up, back] = axes.map((axis) => new THREE.Vector3(...axis));
  camera.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(right, up, back));
  return camera;
}

// Pictures' own colours without light; cut-outs stay as the loader made them.
function flat(material) {
  const { map, alphaMap, alphaTest, transparent, opacity, side, color } = material;
  return new THREE.MeshBasicMaterial({ map, alphaMap, alphaTest, transparent, opacity, side, color });
}

function light(scene, box) {
  const sun = new THREE.DirectionalLight('#fff4e0', 3.2);
  const reach = box.getSize(new THREE.Vector3()).length();
  const middle = box.getCenter(new THREE.Vector3());
  sun.position.copy(middle).add(new THREE.Vector3(0.6, 0.9, 0.7).multiplyScalar(reach));
  sun.target.position.copy(middle);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  Object.assign(sun.shadow.camera, { left: -reach / 2, right: reach / 2, top: reach / 2, bottom: -reach / 2, far: 3 * reach });
  sun.shadow.normalBias = 0.02;
  scene.add(sun, sun.target, new THREE.HemisphereLight('#dfeaff', '#8a8468', 2.6));
}

function ground(scene) {
  const lawn = new THREE.Mesh(
    new THREE.CircleGeometry(400, 64).rotateX(-Math.PI / 2), new THREE.MeshStandardMaterial({ color: '#7d8a55' }));
  lawn.receiveShadow = true;
  scene.add(lawn);
  scene.background = new THREE.Color('#c6dcf0');
  scene.fog = new THREE.Fog('#c6dcf0', 60, 400);
}

// Loads, counts what shows, draws: { counts, picture (data URL of a PNG with alpha) }.
// Looks: `flat`, the pictures' own colours; `lit`; `outdoors`, lit and on a lawn.
window.show = async ({ url, level, camera: through, look }) => {
  const camera = cameraOf(through);
  const model = await load(url, level, camera);
  const scene = new THREE.Scene().add(model);
  scene.updateMatrixWorld(true);
  const box = new THREE.Box3().setFromObject(model, true);
  model.traverse((one) => one.isLOD && one.update(camera));
  const counts = { levels: [], meshes: 0, instances: 0, triangles: 0, materials: {} };
  model.traverseVisible((one) => {
    if (one.isLOD) counts.levels.push(one.getCurrentLevel());
    if (!one.isMesh) return;
    const n = one.isInstancedMesh ? one.count : 1;
    const { index, attributes } = one.geometry;
    counts.meshes += 1;
    counts.instances += one.isInstancedMesh ? n : 0;
    counts.triangles += n * ((index ?? attributes.position).count / 3);
    for (const m of [one.material].flat()) {
      const { type, alphaTest, transparent, side } = m;
      counts.materials[m.name || one.name] = { type, alphaTest, transparent, doubleSided: side === THREE.DoubleSide, map: !!m.map };
    }
    one.castShadow = one.receiveShadow = true;
    if (look === 'flat') one.material = Array.isArray(one.material) ? one.material.map(flat) : flat(one.material);
  });
  // Flat, each pixel is one sample. Antialiasing tests a pixel's texels once, at its centre: leaves lose what of
  // their edge lies beyond, so who measures takes a finer camera instead.
  const renderer = new THREE.WebGLRenderer({ antialias: look !== 'flat', alpha: true, preserveDrawingBuffer: true });
  renderer.setSize(...through.size, false);
  renderer.setClearColor(0, 0);
  if (look !== 'flat') {
    renderer.shadowMap.enabled = true;
    light(scene, box);
  }
  if (look === 'outdoors') ground(scene);
  document.body.append(renderer.domElement);
  renderer.render(scene, camera);
  const picture = renderer.domElement.toDataURL('image/png');
  renderer.dispose();
  return { revision: THREE.REVISION, ...counts, box: [box.min.toArray(), box.max.toArray()], picture };
};
