// packages.mjs - the npm packages of package.json, which run.sh keeps in build/web-tests and not in the source tree.
import {createRequire} from 'node:module';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';

export const ROOT = dirname(dirname(dirname(fileURLToPath(import.meta.url))));
export const BUILD = resolve(ROOT, process.env.BUILD || 'build');

/** A package, as `require` gives it. */
export const requirePackage = createRequire(join(ROOT, 'build', 'web-tests', 'package.json'));
