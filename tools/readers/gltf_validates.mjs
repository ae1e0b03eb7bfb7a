// The Khronos validator on glTF files: `node gltf_validates.mjs a.glb b.glb` prints one report a file, as JSON.
import { readFile } from 'node:fs/promises';
import { validateBytes } from 'gltf-validator';

const reports = [];
for (const path of process.argv.slice(2)) {
  const bytes = new Uint8Array(await readFile(path));
  const report = await validateBytes(bytes, { uri: path, maxIssues: 0, writeTimestamp: false });
  reports.push(report);
}
console.log(JSON.stringify(reports));
