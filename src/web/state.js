// state.js - what the page shows, as the fragment of its URL: so that a view can be linked, kept and loaded again.
//
//   #terrain=NAME&eye=x,y,height&yaw=&pitch=&fovy=&exaggeration=&ask=view|range&tau=&eps=&colour=&wires&mode=orbit|fly
//
// `capture` among them keeps the picture readable after it was shown (tests ask for that).

const KEYS = ['terrain', 'eye', 'yaw', 'pitch', 'fovy', 'exaggeration', 'ask', 'tau', 'eps', 'colour', 'wires', 'mode',
    'morph', 'capture'];

const number = (text, low, high) => {
    const value = Number(text);
    return text !== null && text !== '' && value >= low && value <= high ? value : undefined;
};
const among = (text, names) => names.includes(text) ? text : undefined;

/** What the fragment says; undefined where it says nothing of use. */
export function readFragment(fragment) {
    const given = new URLSearchParams(fragment.replace(/^#/, ''));
    const eye = (given.get('eye') || '').split(',').map(text => number(text, -1e15, 1e15));
    return {
        terrain: given.get('terrain') || undefined,
        camera: eye.length === 3 && eye.every(Number.isFinite) ? {
            eye,
            yaw: number(given.get('yaw'), -1e6, 1e6) || 0,
            pitch: number(given.get('pitch'), -90, 90) || 0,
            fovy: number(given.get('fovy'), 1, 150),
        } : undefined,
        exaggeration: number(given.get('exaggeration'), 0.1, 100),
        ask: among(given.get('ask'), ['view', 'range']),
        tau: number(given.get('tau'), 0.01, 1e4),
        eps: number(given.get('eps'), 0, 1e6),
        colour: among(given.get('colour'), ['relief', 'error', 'plain']),
        wires: given.has('wires') ? given.get('wires') !== '0' : undefined,
        morph: given.has('morph') ? given.get('morph') !== '0' : undefined,
        mode: among(given.get('mode'), ['orbit', 'fly']),
        capture: given.has('capture'),
    };
}

/** @param state values by the names above; those that are undefined or false are left out */
export function writeFragment(state) {
    const parts = [];
    for (const key of KEYS) {
        const value = state[key];
        if (value === undefined || value === false) continue;
        parts.push(value === true ? key : `${key}=${Array.isArray(value) ? value.join(',') : encodeURIComponent(value)}`);
    }
    return `#${parts.join('&')}`;
}
