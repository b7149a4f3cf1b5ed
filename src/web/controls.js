// controls.js - pointers and keys: what they mean is for orbit.js and fly.js.
//
// One pointer drags: the left button or a finger turns, the right or middle button, or shift, pans. Two fingers pan and
// pinch. A pointer that goes down and up at one place is a click.

const STILL = 6; // CSS pixels within which down and up are a click
const TWICE = 400; // milliseconds within which a second one is part of a double-click

export class Controls {
    /**
     * @param element the canvas
     * @param hooks {mode(): Orbit or Fly, click([px, py]), double(), changed()}
     */
    constructor(element, hooks) {
        Object.assign(this, {element, hooks, pointers: new Map(), held: new Set(), press: null, lastClick: null, spread: 0});
        const on = (type, listener, options) => element.addEventListener(type, listener, options);
        on('pointerdown', event => this.down(event));
        on('pointermove', event => this.move(event));
        on('pointerup', event => this.up(event));
        on('pointercancel', event => this.up(event));
        on('wheel', event => this.wheel(event), {passive: false});
        on('contextmenu', event => event.preventDefault());
        on('mousedown', event => event.preventDefault()); // the canvas takes the focus by Tab only
        on('dblclick', () => hooks.double());
        window.addEventListener('keydown', event => this.key(event, true));
        window.addEventListener('keyup', event => this.key(event, false));
        window.addEventListener('blur', () => this.held.clear());
    }

    /** Places of the picture, -1 to 1, out of CSS pixels from the canvas' top left. */
    placeOf([px, py]) {
        const {clientWidth, clientHeight} = this.element;
        return [2 * px / clientWidth - 1, 1 - 2 * py / clientHeight];
    }

    pixelsOf(event) {
        const box = this.element.getBoundingClientRect();
        return [event.clientX - box.left, event.clientY - box.top];
    }

    middle() {
        const all = [...this.pointers.values()], sum = axis => all.reduce((total, at) => total + at[axis], 0) / all.length;
        return [sum(0), sum(1)];
    }

    spreadNow() {
        const [a, b] = this.pointers.values();
        return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
    }

    down(event) {
        this.element.setPointerCapture(event.pointerId);
        document.activeElement?.blur(); // keys move the camera now, and not the slider that was used last
        const at = this.pixelsOf(event);
        this.pointers.set(event.pointerId, at);
        this.press = this.pointers.size === 1 && event.button === 0 ? at : null;
        this.kind = this.pointers.size > 1 || event.button !== 0 || event.shiftKey ? 'pan' : 'turn';
        this.spread = this.spreadNow();
        this.hooks.mode().end();
        this.hooks.mode().begin(this.placeOf(this.middle()));
    }

    move(event) {
        if (!this.pointers.has(event.pointerId)) return;
        const before = this.middle();
        this.pointers.set(event.pointerId, this.pixelsOf(event));
        const now = this.middle();
        if (this.press) {
            if (Math.hypot(now[0] - this.press[0], now[1] - this.press[1]) < STILL) return;
            this.press = null;
        }
        const mode = this.hooks.mode(), from = this.placeOf(before), to = this.placeOf(now);
        mode.drag(this.kind, from, to, event.pointerType === 'touch');
        const spread = this.spreadNow();
        if (spread > 0 && this.spread > 0) mode.zoom(this.spread / spread, to);
        this.spread = spread;
        this.hooks.changed();
    }

    up(event) {
        if (!this.pointers.delete(event.pointerId)) return;
        const press = this.press;
        this.press = null;
        this.hooks.mode().end();
        if (this.pointers.size) {
            this.kind = 'turn';
            this.hooks.mode().begin(this.placeOf(this.middle()));
        } else if (press && event.type === 'pointerup') {
            const last = this.lastClick, isSecond = last && event.timeStamp - last.time < TWICE &&
                Math.hypot(press[0] - last.at[0], press[1] - last.at[1]) < STILL;
            this.lastClick = {at: press, time: event.timeStamp};
            if (!isSecond) this.hooks.click(press);
        }
    }

    wheel(event) {
        event.preventDefault();
        const lines = event.deltaMode === 1 ? 30 : 1, amount = Math.max(-240, Math.min(240, event.deltaY * lines));
        this.hooks.mode().zoom(Math.exp(amount * 0.0016), this.placeOf(this.pixelsOf(event)));
        this.hooks.changed();
    }

    key(event, isDown) {
        const isArrow = event.code.startsWith('Arrow'), {target} = event;
        const isTheirs = target.closest?.('select, dialog') || isArrow && target.closest?.('input, [role=tablist]') ||
            event.code.startsWith('Page') && target.matches?.('[type=range]');
        if (!isDown) this.held.delete(event.code);
        else if (!isTheirs && !event.ctrlKey && !event.metaKey && !event.altKey) this.held.add(event.code);
        this.isFast = event.shiftKey;
        if (isDown && !isTheirs && isArrow) event.preventDefault();
    }

    /** Moves by the keys that are held; is any? */
    step(seconds, isFlying) {
        const is = (...codes) => codes.some(code => this.held.has(code)) ? 1 : 0;
        const wish = {
            ahead: is('KeyW') - is('KeyS'), right: is('KeyD') - is('KeyA'), fast: this.isFast,
            up: is('KeyE', 'PageUp') - is('KeyQ', 'PageDown'),
            yaw: is('KeyL') - is('KeyJ'), pitch: is('KeyI') - is('KeyK'),
        };
        const right = is('ArrowRight') - is('ArrowLeft'), up = is('ArrowUp') - is('ArrowDown');
        if (isFlying) {
            wish.ahead = wish.ahead || up;
            wish.right = wish.right || right;
        } else {
            wish.yaw = wish.yaw || right;
            wish.pitch = wish.pitch || up;
            wish.up += is('Minus', 'NumpadSubtract') - is('Equal', 'NumpadAdd');
        }
        const isAny = ['ahead', 'right', 'up', 'yaw', 'pitch'].some(key => wish[key]);
        if (isAny) this.hooks.mode().step(seconds, wish);
        return isAny;
    }
}
