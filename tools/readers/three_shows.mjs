// three.js in a headless Chromium: `node three_shows.mjs jobs.json`, jobs as [{ file, level, camera, look, picture }].
// Draws each file through its camera into the PNG `picture`, and prints what three.js counted, as JSON.
import { createReadStream, existsSync } from 'node:fs';
import { readFile, writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

const HERE = path.dirname(fileURLToPath(import.meta.url));
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.png': 'image/png' };
const BROWSERS = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];

// Serves this folder, and as /job/3/... the folder of the third job's file: nothing comes from elsewhere.
function serve(jobs) {
  const server = createServer((request, response) => {
    const url = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
    const [, which, rest] = url.match(/^\/job\/(\d+)\/(.*)$/) ?? [];
    const root = which === undefined ? HERE : path.dirname(path.resolve(jobs[which].file));
    const file = path.join(root, which === undefined ? url : rest);
    if (!file.startsWith(root + path.sep) || !existsSync(file)) return response.writeHead(404).end();
    response.setHeader('Content-Type', TYPES[path.extname(file)] ?? 'application/octet-stream');
    createReadStream(file).pipe(response);
  });
  return new Promise((ready) => server.listen(0, '127.0.0.1', () => ready(server)));
}

const jobs = JSON.parse(await readFile(process.argv[2]));
const server = await serve(jobs);
const home = `http://127.0.0.1:${server.address().port}`;
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? BROWSERS.find(existsSync),
  args: process.getuid() === 0 ? ['--no-sandbox'] : [], // root has no sandbox to go into
});
const results = [];
try {
  for (const [k, job] of jobs.entries()) {
    const page = await browser.newPage();
    const complaints = [];
    page.on('console', (one) => {
      const isReadback = one.text().includes('due to ReadPixels'); // it is we who read the picture back
      if (['error', 'warning'].includes(one.type()) && !isReadback) complaints.push(one.text());
    });
    page.on('pageerror', (error) => complaints.push(String(error)));
    await page.goto(`${home}/three_page.html`);
    await page.waitForFunction(() => window.show);
    const url = `${home}/job/${k}/${encodeURIComponent(path.basename(job.file))}`;
    const { picture, ...result } = await page.evaluate((one) => window.show(one), { ...job, url });
    await writeFile(job.picture, Buffer.from(picture.split(',')[1], 'base64'));
    results.push({ ...result, complaints });
    await page.close();
  }
} finally {
  await browser.close();
  server.close();
}
console.log(JSON.stringify(results));
