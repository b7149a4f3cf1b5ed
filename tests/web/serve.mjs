// serve.mjs - terrains of the tests, the service that shows them, and SQL's own answers about them.
import {execFile, execFileSync, spawn} from 'node:child_process';
import {existsSync, mkdirSync, mkdtempSync, openSync, readFileSync, renameSync, rmSync, statSync} from 'node:fs';
import {join} from 'node:path';
import {promisify} from 'node:util';
import {BUILD, ROOT} from './packages.mjs';

const RQT = process.env.RQT || join(BUILD, 'rqt');
const RQT_SO = process.env.RQT_SO || join(BUILD, 'rqt.so');
const HOME = join(ROOT, 'build', 'web-tests');
const data = name => join(ROOT, 'tests', 'data', name);

/** One terrain of each kind that the page tells apart. `bare` has no CRS, `ragged` voids; the others have none. */
export const TERRAINS = {
    degrees: {source: join(ROOT, 'examples', 'N44W072.hgt.zip'), voids: false},
    metres: {source: data('glarus_alpine_25m_161.tif'), voids: false},
    bare: {source: data('glarus_gentle_25m_161.tif'), withoutCrs: true, voids: false},
    ragged: {source: data('SainteHelens.dem'), voids: true},
};

/** The database that holds them all; made when it is missing or older than the program. */
export function terrainDatabase() {
    const database = join(HOME, 'terrains.gpkg');
    if (existsSync(database) && statSync(database).mtimeMs > statSync(RQT).mtimeMs) return database;
    mkdirSync(HOME, {recursive: true});
    const making = mkdtempSync(join(HOME, 'making-'));
    try {
        for (const [name, {source, withoutCrs}] of Object.entries(TERRAINS)) {
            let raster = source;
            if (withoutCrs) {
                raster = join(making, `${name}.asc`);
                execFileSync('gdal_translate', ['-q', '-of', 'AAIGrid', source, raster]);
                rmSync(join(making, `${name}.prj`));
            }
            execFileSync(RQT, ['import', '--name', name, raster, join(making, 'terrains.gpkg')], {stdio: 'pipe'});
        }
        renameSync(join(making, 'terrains.gpkg'), database);
    } finally {
        rmSync(making, {recursive: true});
    }
    return database;
}

/** Rows of a statement, numbers exactly as they are. Parameters: {name: value} for `:name`. */
export async function sql(statement, parameters = {}, database = terrainDatabase()) {
    const literal = value =>
        value === null ? 'NULL' : typeof value === 'number' ? doubleLiteral(value) : `'${String(value).replaceAll("'", "''")}'`;
    const text = statement.replace(/:([a-z]\w*)/g, (whole, name) =>
        Object.hasOwn(parameters, name) ? literal(parameters[name]) : whole);
    const {stdout} = await promisify(execFile)(
        'sqlite3', ['-readonly', '-json', database, '-cmd', `.load ${RQT_SO}`, text], {maxBuffer: 1 << 30});
    return stdout.trim() ? JSON.parse(stdout) : [];
}

/** SQLite reads this many digits as the same double. */
function doubleLiteral(value) {
    return Number.isInteger(value) && Math.abs(value) < 2 ** 53 ? `${value}.0` : value.toExponential(17);
}

const running = new Set();
process.on('exit', () => running.forEach(child => child.kill('SIGKILL')));

/** `rqt serve` on a port of its own. */
export class Service {
    static async start({databases = [terrainDatabase()], port = 0, options = []} = {}) {
        const log = join(HOME, `serve-${process.pid}-${Date.now()}.log`);
        const child = spawn(RQT, ['serve', '--port', String(port), ...options, ...databases], {stdio: ['ignore', 'pipe', openSync(log, 'w')]});
        running.add(child);
        const ended = new Promise(resolve => child.once('exit', (status, signal) => { running.delete(child); resolve({status, signal}); }));
        let said = '';
        const url = await new Promise((resolve, reject) => {
            child.stdout.on('data', chunk => { said += chunk; if (said.includes('\n')) resolve(said.split('\n')[0].trim()); });
            ended.then(({status}) => reject(new Error(`rqt serve ended with ${status}: ${readFileSync(log, 'utf8')}`)));
        });
        const service = new Service();
        Object.assign(service, {child, url, ended, log, port: Number(new URL(url).port)});
        return service;
    }

    /** Ends those that a failed test has left, so that the runner need not wait for them. */
    static endAll() {
        running.forEach(child => child.kill('SIGKILL'));
    }

    /** Ends it; its exit status and what it said on stderr. */
    async stop(signal = 'SIGTERM') {
        this.child.kill(signal);
        const {status} = await this.ended;
        const said = readFileSync(this.log, 'utf8');
        rmSync(this.log, {force: true});
        return {status, said};
    }
}
