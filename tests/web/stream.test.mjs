// stream.test.mjs - one question under way, the newest wish waits, and what goes wrong stops nothing. The service and the
// worker are stood in for: what is looked at is who is asked when.
import assert from 'node:assert/strict';
import {beforeEach, test} from 'node:test';

/** Questions that wait for their answer: [{path, answer(status), fail()}]. */
let asked, underWay, most;
globalThis.fetch = path => new Promise((resolve, reject) => {
    most = Math.max(most, ++underWay);
    const end = act => value => { underWay--; act(value); };
    asked.push({
        path,
        answer: (status = 200) => end(resolve)(new Response(status === 200 ? new Uint8Array([path.length]) : JSON.stringify({detail: `rqt_view(): no ${path}`}),
            {status, headers: {'Content-Type': status === 200 ? 'application/octet-stream' : 'application/problem+json', 'RQT-Achieved-Tau': '2.5'}})),
        fail: () => end(reject)(new TypeError('Failed to fetch')),
    });
});
let decoded;
globalThis.Worker = class {
    postMessage(job) {
        decoded.push(job);
        setTimeout(() => this.onmessage({data: {id: job.id, mesh: {}, geometry: {}, morph: null, milliseconds: 1}}));
    }
};
const {Stream} = await import('../../src/web/stream.js');

const TERRAIN = {lonlat: false, metre: 1};
const wish = (path, more = {}) => ({path, terrain: TERRAIN, exaggeration: 1, withEdges: false, withMorph: true, origin: [0, 0, 0], ...more});
/** Until nothing is left to do but to wait for the service. */
const turn = async () => { for (let i = 0; i < 50; i++) await new Promise(resolve => setTimeout(resolve)); };
let shown, failed, stream;
beforeEach(() => {
    [asked, decoded, shown, failed, underWay, most] = [[], [], [], [], 0, 0];
    stream = new Stream(async stage => { shown.push(stage); }, sentence => failed.push(sentence));
});
const paths = list => list.map(({path, wish: of}) => path ?? of.path);

test('while one is asked the newest waits, and those between are never asked', async () => {
    for (const path of ['a', 'b', 'c', 'd']) stream.want(wish(path));
    await turn();
    assert.deepEqual(paths(asked), ['a']);
    assert.equal(stream.isSettled, false);
    asked[0].answer();
    await turn();
    assert.deepEqual(paths(asked), ['a', 'd']);
    asked[1].answer();
    await turn();
    assert.deepEqual(paths(shown), ['a', 'd']);
    assert.equal(shown[1].told.achievedTau, 2.5);
    assert.equal(most, 1);
    assert.equal(stream.isSettled, true);
});

test('what is shown is not asked for again, and what is shown otherwise is not either', async () => {
    stream.want(wish('a'));
    asked[0].answer();
    await turn();
    for (let i = 0; i < 5; i++) stream.want(wish('a', {origin: [i, 0, 0]}));
    await turn();
    assert.equal(asked.length, 1);
    assert.equal(decoded.length, 1);
    stream.want(wish('a', {withEdges: true}));
    await turn();
    assert.equal(asked.length, 1);
    assert.equal(decoded.length, 2);
    assert.equal(decoded[1].bytes, null);
    assert.deepEqual([decoded[0].terrain, decoded[1].terrain], [TERRAIN, null]);
});

test('a problem is said in its sentence, and the next wish is asked', async () => {
    stream.want(wish('a'));
    asked[0].answer(400);
    await turn();
    assert.deepEqual(failed, ['No a']);
    assert.equal(stream.isSettled, true);
    stream.want(wish('a'));
    await turn();
    assert.equal(asked.length, 1, 'what cannot be is not asked again');
    stream.want(wish('b'));
    asked[1].answer();
    await turn();
    assert.deepEqual(paths(shown), ['b']);
    assert.equal(most, 1);
});

test('a service that is gone is asked again until it is back', async t => {
    const waiting = [], real = globalThis.setTimeout;
    globalThis.setTimeout = (act, milliseconds) => waiting.push({act, milliseconds});
    t.after(() => { globalThis.setTimeout = real; });
    const settle = async () => { for (let i = 0; i < 20; i++) await Promise.resolve(); };
    stream.want(wish('a'));
    for (let round = 1; round < 4; round++) {
        asked[round - 1].fail();
        await settle();
        assert.equal(failed.length, round);
        assert.match(failed[0], /does not answer/);
        assert.equal(asked.length, round, 'not at once');
        const {act, milliseconds} = waiting.pop();
        assert.ok(milliseconds >= 1000);
        act();
        await settle();
        assert.equal(asked.length, round + 1);
    }
    stream.want(wish('b'));
    asked[3].fail();
    await settle();
    assert.deepEqual(paths(asked), ['a', 'a', 'a', 'a', 'b']);
    assert.equal(most, 1);
});
