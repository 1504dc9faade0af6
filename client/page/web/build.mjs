// build.mjs MODULES OUT: bundles the page's modules, puts style and program into the HTML and writes it as C++.
// MODULES is the folder with node_modules; OUT the file to write.
import { readFile, writeFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));
const [modules, out] = process.argv.slice(2);
const esbuild = createRequire(path.join(path.resolve(modules), 'package.json'))('esbuild');

const bundle = await esbuild.build({
  entryPoints: [path.join(here, 'main.js')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2022',
  legalComments: 'inline',
  charset: 'utf8',
  write: false,
  nodePaths: [path.join(path.resolve(modules), 'node_modules')],
  logLevel: 'warning',
});
const style = await esbuild.transform(await readFile(path.join(here, 'page.css'), 'utf8'), {
  loader: 'css',
  minify: true,
});

const html = (await readFile(path.join(here, 'index.html'), 'utf8'))
  .replace('{{STYLE}}', () => style.code.trim())
  .replace('{{PROGRAM}}', () => bundle.outputFiles[0].text.trim());
if (html.includes(')page"')) throw new Error('the page holds the end of its own C++ literal');
for (const place of ['{{TITLE}}', '{{SESSION}}', '{{DATA}}'])
  if (html.split(place).length !== 2) throw new Error(`${place} must stand in the page once`);

// In pieces: compilers need not take a literal of any length.
const pieces = html.match(/[^]{1,15000}/gu).map((piece) => `R"page(${piece})page"`);
await writeFile(
  out,
  `// Made by client/page/web/build.mjs.
# include "client/page/page_template.h"

namespace sightline {

std::string_view page_template() {
  static constexpr char kPage[] =
${pieces.join('\n')};
  return std::string_view(kPage, sizeof kPage - 1);
}

}  // namespace sightline
`,
);
