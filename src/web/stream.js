// stream.js - from what is wanted to what is shown: one request under way, and the newest wish waits.
//
// A wish is {path, terrain, exaggeration, origin, withEdges, withMorph}; it is the one before when path, exaggeration and
// withEdges are. So a camera that does not move asks nothing, and one that does is asked for as it then is. Where only the
// way in which a mesh is shown changes, its bytes are not asked for again.

import {askMesh} from './service.js';

const RETRY_MILLISECONDS = 3000;

const keyOf = wish => `${wish.exaggeration} ${wish.withEdges} ${wish.path}`;

export class Stream {
    /**
     * @param show called with each answer, {wish, mesh, geometry, morph, told, bytes, milliseconds: {answer, decode}}; it
     *     returns a promise that is kept when the next may come
     * @param fail called with a sentence
     */
    constructor(show, fail) {
        Object.assign(this, {show, fail, wanted: null, doneKey: '', isBusy: false});
        this.worker = new Worker('decoder.js');
        this.jobs = new Map();
        this.jobCount = 0;
        this.terrain = null;
        this.path = '';
        this.answer = null;
        this.worker.onmessage = ({data}) => {
            const {resolve, reject} = this.jobs.get(data.id);
            this.jobs.delete(data.id);
            if (data.problem) reject(new Error(data.problem));
            else resolve(data);
        };
        this.worker.onerror = event => {
            for (const {reject} of this.jobs.values()) reject(new Error(`The decoder stopped: ${event.message}`));
            this.jobs.clear();
        };
    }

    /** Is what was wanted last shown, or known not to be possible? */
    get isSettled() {
        return !this.isBusy && (!this.wanted || keyOf(this.wanted) === this.doneKey);
    }

    want(wish) {
        this.wanted = wish;
        if (!this.isBusy) this.run();
    }

    /** Asks again what could not be answered, if it is still wanted. */
    retry(wish) {
        if (this.isBusy || keyOf(wish) !== this.doneKey) return;
        this.doneKey = '';
        this.run();
    }

    async run() {
        this.isBusy = true;
        while (!this.isDone()) {
            const wish = this.wanted;
            try {
                await this.fulfil(wish);
            } catch (problem) {
                this.path = ''; // what the worker has may not be what is shown
                this.fail(problem.message);
                if (problem.mayPass) setTimeout(() => this.retry(wish), RETRY_MILLISECONDS);
            }
            this.doneKey = keyOf(wish);
        }
        this.isBusy = false;
    }

    isDone() {
        return keyOf(this.wanted) === this.doneKey;
    }

    async fulfil(wish) {
        const isKnown = wish.path === this.path;
        if (!isKnown) this.answer = await askMesh(wish.path);
        const {bytes, milliseconds, ...told} = this.answer;
        const made = await this.decode(wish, isKnown ? null : bytes);
        this.path = wish.path;
        await this.show({
            wish, told, bytes: bytes.length, mesh: made.mesh, geometry: made.geometry, morph: made.morph,
            milliseconds: {answer: milliseconds, decode: made.milliseconds},
        });
    }

    decode({terrain, exaggeration, origin, withEdges, withMorph}, bytes) {
        const id = ++this.jobCount, isNew = terrain !== this.terrain;
        this.terrain = terrain;
        return new Promise((resolve, reject) => {
            this.jobs.set(id, {resolve, reject});
            this.worker.postMessage({
                id, bytes, exaggeration, origin, withEdges, withMorph, terrain: isNew ? terrain : null,
            });
        });
    }
}
