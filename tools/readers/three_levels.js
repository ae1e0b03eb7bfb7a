// GLTFLoader draws the finest level of a tree and leaves the others unread. This reads them into a THREE.LOD a tree.
import * as THREE from 'three';

// `gltf` as GLTFLoader gave it, `fov` of the camera in degrees. Each level is drawn from where the next finer
// one is as small on the screen as MSFT_screencoverage says, in shares of the screen's height.
export async function withLevels(gltf, fov) {
  const { json } = gltf.parser;
  const trees = new THREE.Group();
  const finest = [...gltf.scene.children];
  for (const [k, index] of json.scenes[json.scene].nodes.entries()) {
    const { extensions, extras } = json.nodes[index];
    const lod = new THREE.LOD();
    lod.name = finest[k].name;
    finest[k].matrix.decompose(lod.position, lod.quaternion, lod.scale);
    add(lod, finest[k], 0);
    for (const [n, id] of (extensions?.MSFT_lod?.ids ?? []).entries()) {
      const height = lod.scale.y * extras.forestgen.height;
      const share = extras.MSFT_screencoverage[n];
      const distance = height / (2 * share * Math.tan(THREE.MathUtils.degToRad(fov) / 2));
      add(lod, await gltf.parser.getDependency('node', id), distance);
    }
    trees.add(lod);
  }
  return trees;
}

// The place is the LOD's own: it measures distances from there.
function add(lod, level, distance) {
  level.position.set(0, 0, 0);
  level.quaternion.identity();
  level.scale.set(1, 1, 1);
  level.updateMatrix();
  lod.addLevel(level, distance);
}
