"""Cameras for the proof of views: random ones, and those that break published methods; and the proof of one camera.

A camera is made of a terrain's row and dice alone, so a seed gives the same cameras everywhere. KINDS says what each kind is about;
eyes are in the terrain's own coordinates unless a kind is about that.
"""
import json
import math

TERRAIN = "SELECT name, srid, width, height, min_z, max_z, x0, y0, dx, dy, quantum_error FROM rqt_terrains"


class Terrain:
    def __init__(self, db):
        names = "name srid width height min_z max_z x0 y0 dx dy quantum_error".split()
        self.__dict__.update(zip(names, db.execute(TERRAIN).fetchone()))
        self.db = db
        self.degrees = self.srid == 4326
        latitude = self.y0 + self.height / 2 * self.dy
        # metres in a unit of x and y
        self.mx = 111320 * math.cos(math.radians(latitude)) if self.degrees else 1.0
        self.my = 110570.0 if self.degrees else 1.0
        self.size = max(abs(self.dx) * self.width * self.mx, abs(self.dy) * self.height * self.my)
        self.cell = max(abs(self.dx) * self.mx, abs(self.dy) * self.my)

    def at(self, col, row):
        return self.x0 + col * self.dx, self.y0 + row * self.dy

    def sample(self, dice):
        """Column, row and height of a valid sample."""
        while True:
            col, row = dice.below(self.width), dice.below(self.height)
            z = self.db.execute("SELECT rqt_height(?, ?)", self.at(col, row)).fetchone()[0]
            if z is not None:
                return col, row, z


def share(dice, low=0.0, high=1.0):
    return low + (high - low) * dice.below(1 << 30) / (1 << 30)


def log_share(dice, low, high):
    return math.exp(share(dice, math.log(low), math.log(high)))


def picture(dice, **more):
    """What a camera is without a place: half of them an ordinary picture, the others anything."""
    ordinary = dice.below(2)
    camera = {"fovy": share(dice, 20, 70) if ordinary else log_share(dice, 0.01, 170),
              "width": 1280 if ordinary else 1 + dice.below(4000), "height": 800 if ordinary else 1 + dice.below(4000),
              "tau": log_share(dice, 0.5, 8) if ordinary else log_share(dice, 0.1, 50)}
    camera.update(more)
    return camera


def anywhere(dice):
    """Any direction, level ones more often."""
    return {"yaw": share(dice, -180, 180), "pitch": share(dice, -90, 90) * share(dice)}


def above(t, dice, height):
    """An eye that high above a sample that is valid, heights as they are."""
    col, row, z = t.sample(dice)
    x, y = t.at(col + share(dice, -0.5, 0.5), row + share(dice, -0.5, 0.5))
    return [x, y, z + height]


def target(t, dice):
    col, row, z = t.sample(dice)
    return list(t.at(col, row)) + [z]


def overlook(t, dice):
    eye = above(t, dice, log_share(dice, 2, t.size))
    return picture(dice, eye=eye, at=target(t, dice))


def random_direction(t, dice):
    return picture(dice, eye=above(t, dice, log_share(dice, 0.1, t.size)), **anywhere(dice))


def below_ground(t, dice):
    """Looking anywhere, or up at the ground."""
    eye = above(t, dice, -log_share(dice, 0.01, 2 * t.size))
    return picture(dice, eye=eye, **anywhere(dice)) if dice.below(2) else picture(dice, eye=eye, at=target(t, dice))


def on_a_vertex(t, dice):
    return picture(dice, eye=target(t, dice), **anywhere(dice))


def beside_a_vertex(t, dice):
    """A few ulp off it, and off the line from one sample to the next."""
    eye = target(t, dice)
    for i in range(3):
        for _ in range(dice.below(3)):
            eye[i] = math.nextafter(eye[i], math.inf)
    return picture(dice, eye=eye, at=target(t, dice))


def inside_a_box(t, dice):
    col, row = share(dice, 0, t.width - 1), share(dice, 0, t.height - 1)
    return picture(dice, eye=list(t.at(col, row)) + [share(dice, t.min_z, t.max_z)], **anywhere(dice))


def straight_down(t, dice):
    return picture(dice, eye=above(t, dice, log_share(dice, 1, 10 * t.size)), yaw=90 * dice.below(4), pitch=-90)


def straight_down_at(t, dice):
    """By a target, which is below the eye but for a rounding."""
    eye = target(t, dice)
    at = [eye[0], eye[1], eye[2] - log_share(dice, 1e-3, 1e4)]
    eye[2] += log_share(dice, 1, 10 * t.size)
    return picture(dice, eye=eye, at=at)


def straight_up(t, dice):
    return picture(dice, eye=above(t, dice, -log_share(dice, t.cell, 3 * t.size)), yaw=share(dice, 0, 360), pitch=90)


def long_lens(t, dice):
    eye = above(t, dice, log_share(dice, 10, 100 * t.size))
    return picture(dice, eye=eye, at=target(t, dice), fovy=log_share(dice, 0.01, 1))


def widest_lens(t, dice):
    return picture(dice, eye=above(t, dice, log_share(dice, 0.5, t.size)), fovy=share(dice, 120, 170), **anywhere(dice))


def at_infinity(t, dice):
    """1e9 m away in any direction above the ground, with a long lens or not."""
    at, turn, up = target(t, dice), share(dice, 0, 2 * math.pi), share(dice, 0, math.pi / 2)
    if t.degrees:
        eye = [at[0] + 90 * math.cos(up) * math.cos(turn), at[1] * math.sin(up) + 80 * math.cos(up) * math.sin(turn), 1e9]
    else:
        eye = [at[0] + 1e9 * math.cos(up) * math.cos(turn), at[1] + 1e9 * math.cos(up) * math.sin(turn), 1e9 * math.sin(up)]
    return picture(dice, eye=eye, at=at, fovy=0.01 if dice.below(3) else share(dice, 0.01, 60), tau=log_share(dice, 0.1, 1))


def far_outside(t, dice):
    """Beside the terrain, up to a hundred of its sizes, looking across it."""
    away, turn = log_share(dice, t.size, 100 * t.size), share(dice, 0, 2 * math.pi)
    at = target(t, dice)
    if t.degrees:
        away = min(away, 2e6)
    eye = [at[0] + away * math.cos(turn) / t.mx, at[1] + away * math.sin(turn) / t.my, log_share(dice, 10, 1e4)]
    if t.degrees:
        eye[1] = max(-89.0, min(89.0, eye[1]))
    return picture(dice, eye=eye, at=at, fovy=log_share(dice, 0.5, 60))


def along_a_line(t, dice):
    """In a row or column of samples, at the height of one of them, along it."""
    col, row, z = t.sample(dice)
    across = dice.below(2)
    x, y = t.at(-share(dice, 0, 50) if across else col, row if across else t.height + share(dice, 0, 50))
    return picture(dice, eye=[x, y, z], yaw=90 if across else 0, pitch=0)


def near_and_far(t, dice):
    """Planes of depth through samples, as exactly as numbers go."""
    col, row, z = t.sample(dice)
    x, y = t.at(col, row + dice.below(40))
    step = abs(t.dy) * t.my
    near = step * dice.below(60)
    return picture(dice, eye=[x, y, z + log_share(dice, 0.1, 1000)], yaw=0, pitch=0, near=near,
                   far=near + step * (1 + dice.below(200)))


def exaggerated(t, dice):
    e = log_share(dice, 0.1, 10)
    eye, at = above(t, dice, 0), target(t, dice)
    eye[2], at[2] = eye[2] * e + log_share(dice, 0.1, t.size), at[2] * e
    return picture(dice, eye=eye, at=at, exaggeration=e)


def rolled(t, dice):
    camera = overlook(t, dice)
    camera["roll"] = share(dice, -180, 180)
    return camera


KINDS = [overlook, random_direction, below_ground, on_a_vertex, beside_a_vertex, inside_a_box, straight_down, straight_down_at,
         straight_up, long_lens, widest_lens, at_infinity, far_outside, along_a_line, near_and_far, exaggerated, rolled]


def cameras(t, dice, count):
    """Pairs of kind and camera, the kinds in turn."""
    for i in range(count):
        kind = KINDS[i % len(KINDS)]
        yield kind.__name__, kind(t, dice)


PROOF = ("samples drawn vertices triangles max_pixels rms_pixels x y z t_junctions overlaps achieved_tau guaranteed "
         "uncovered").split()


def prove(db, camera, options=None):
    """The row of rqt_view_verify as a dict, with ratio: the worst displacement over tau."""
    row = db.execute("SELECT %s FROM rqt_view_verify(?, NULL, ?)" % ", ".join(PROOF),
                     (json.dumps(camera), json.dumps(options) if options else None)).fetchone()
    seen = dict(zip(PROOF, row))
    seen["ratio"] = seen["max_pixels"] / seen["achieved_tau"] if seen["max_pixels"] is not None else math.nan
    return seen


def is_outside(camera, low, high, pixels):
    """Is a box of a projected terrain wholly beyond one side of the frustum, grown by that many pixels? The camera has yaw and pitch, and
    neither near nor far."""
    focal = camera["height"] / 2 / math.tan(math.radians(camera["fovy"] / 2))
    yaw, pitch = math.radians(camera["yaw"]), math.radians(camera["pitch"])
    forward = (math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch))
    right = (math.cos(yaw), -math.sin(yaw), 0)
    up = tuple(right[(k + 1) % 3] * forward[(k + 2) % 3] - right[(k + 2) % 3] * forward[(k + 1) % 3] for k in range(3))
    wide, tall = (camera["width"] / 2 + pixels) / focal, (camera["height"] / 2 + pixels) / focal
    seen = []
    for corner in range(8):
        ray = [(high if corner >> k & 1 else low)[k] - camera["eye"][k] for k in range(3)]
        seen.append([sum(a * b for a, b in zip(ray, axis)) for axis in (right, up, forward)])
    sides = (lambda p: p[2] <= 0, lambda p: p[0] > wide * p[2], lambda p: -p[0] > wide * p[2], lambda p: p[1] > tall * p[2],
             lambda p: -p[1] > tall * p[2])
    return any(all(side(p) for p in seen) for side in sides)


def faults(t, seen):
    """What of a view is not as promised; "" when all is. Where heights were rounded, not every view is guaranteed for those of the
    source; for the stored ones it is, and these are projected."""
    wrong = []
    if not seen["ratio"] <= 1:
        wrong.append("%r of tau" % seen["ratio"])
    wrong += ["%s %r" % (n, seen[n]) for n in ("t_junctions", "overlaps", "uncovered") if seen[n] != 0]
    if seen["guaranteed"] != 1 and t.quantum_error == 0:
        wrong.append("not guaranteed")
    return ", ".join(wrong)
