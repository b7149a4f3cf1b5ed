#!/usr/bin/python3
"""Views that follow a camera, in SQL: budgets against every step of the ladder, tokens, bands, increments as a client reads them, another connection,
another state of the database."""
import json
import math
import sqlite3
import time

import sql_support as s
from sql_increment import Increment, Mesh
from sql_support import check, equal, one, raises, rows

BASE = s.temp("previous.gpkg")
GRID = s.rough_grid(130, 97, 7, voids=20)
s.import_terrain(BASE, s.write_grid(s.temp("hills.asc"), GRID, cell=10), name="hills", block=4)
s.import_terrain(BASE, s.write_grid(s.temp("flat.asc"), [[5] * 33 for _ in range(33)]), name="flat", block=3)
s.import_terrain(BASE, s.write_grid(s.temp("lonlat.asc"), s.rough_grid(65, 65, 3), x0=10, y0=46, cell=0.01, crs=s.WGS84), name="lonlat",
                 block=4)
db = s.connect(BASE)
other = s.connect(BASE)


def camera(x, y, z, **more):
    view = {"eye": [x, y, z], "yaw": 20, "pitch": -40, "fovy": 60, "width": 400, "height": 300, "tau": 2}
    view.update(more)
    return json.dumps(view)


def options(**given):
    return json.dumps(given) if given else None


HERE = camera(300, -700, 400)


# ---------------------------------------------------------------------------------------------------------- budgets

def count_of(view, **given):
    return one(db, "SELECT count(*), max(achieved_tau) FROM rqt_view_triangles(?, 'hills', ?)", view, options(**given))


def test_budgets():
    everything, tau = count_of(HERE)
    equal("F38_without_a_budget_tau_is_what_was_asked_for", tau, 2.0)
    equal("F38_a_budget_that_is_large_enough_changes_nothing", count_of(HERE, max_triangles=everything), (everything, 2.0))
    # Down the ladder, by asking for fewer triangles than the step before had.
    steps, budget = [(everything, 2.0)], everything - 1
    while budget > 0:
        try:
            count, achieved = count_of(HERE, max_triangles=budget)
        except sqlite3.Error as error:
            check("F38_a_budget_that_no_tolerance_keeps_is_a_sentence", "even the coarsest mesh of this view has %d triangles" % steps[-1][0]
                  in str(error), error)
            break
        steps.append((count, achieved))
        budget = count - 1 - count // 50
    check("F38_a_ladder_of_many_steps", len(steps) > 20, len(steps))
    check("F38_counts_fall_and_tolerances_rise", all(a[0] > b[0] and a[1] < b[1] for a, b in zip(steps, steps[1:])), steps[:5])
    check("F38_tolerances_are_steps_of_2^(1/128)", all(abs(math.log2(t / 2) * 128 - round(math.log2(t / 2) * 128)) < 1e-6 for _, t in steps),
          steps[:5])
    # The tolerance of a budget is the least: one triangle less than a step has is the next step that has fewer, and all budgets between two
    # counts get the lower one.
    dice, fine = s.Dice(5), True
    for _ in range(10):
        high = steps[dice.below(len(steps) - 1)]
        low = count_of(HERE, max_triangles=high[0] - 1)
        fine &= low[1] > high[1] and low[0] < high[0]
        fine &= count_of(HERE, max_triangles=low[0] + dice.below(high[0] - low[0])) == low
    check("F38_the_smallest_tolerance_that_keeps_the_budget", fine)
    for budget in (1, 2, 3):
        try:
            count, _ = count_of(HERE, max_triangles=budget)
            check("F38_budget_%d" % budget, count <= budget, count)
        except sqlite3.Error as error:
            check("F38_budget_%d" % budget, "even the coarsest" in str(error), error)
    flat = camera(16, -40, 30, pitch=-20, yaw=0)
    equal("F38_ties_a_plane_takes_two_triangles_whatever_tau",
          one(db, "SELECT count(*), max(achieved_tau) FROM rqt_view_triangles(?, 'flat', '{\"max_triangles\":2}')", flat), (2, 2.0))
    raises("F38_of_fewer_than_the_mesh_of_corners", "even the coarsest mesh of this view has 2 triangles",
           lambda: rows(db, "SELECT * FROM rqt_view(?, 'flat', '{\"max_triangles\":1}')", flat))
    raises("a budget of none", "option \"max_triangles\" must be an integer of 1 or more", lambda: count_of(HERE, max_triangles=0))
    raises("a budget is for views", "option \"max_triangles\" is for views",
           lambda: rows(db, "SELECT * FROM rqt_range(NULL, 1, 'hills', '{\"max_triangles\":9}')"))


# -------------------------------------------------------------------------------------------------------- following

def increment(view, token, connection=db, terrain="hills", **given):
    return one(connection, "SELECT rqt_view_mesh(?, 'increment', ?, ?)", view, terrain, options(previous=token, **given))


def mesh_of(view, connection=db, terrain="hills", **given):
    """The same from rows."""
    found = rows(connection, "SELECT col, row, q FROM rqt_view(?, ?, ?)", view, terrain, options(**given))
    blob = one(connection, "SELECT rqt_view_mesh(?, 'indexed', ?, ?)", view, terrain, options(**given))
    import struct
    vertices, indices = struct.unpack_from("<QQ", blob, 16)
    records = [struct.unpack_from("<iii", blob, 128 + 12 * i) for i in range(vertices)]
    flat = struct.unpack_from("<%dI" % indices, blob, 128 + 12 * vertices)
    mesh = Mesh.of(records, [flat[i:i + 3] for i in range(0, indices, 3)])
    check("rows and file have the same vertices", sorted(found) == sorted(records)) if sorted(found) != sorted(records) else None
    return mesh


class Client:
    """Follows increments alone."""

    def __init__(self, connection=db, terrain="hills", **given):
        self.connection, self.terrain, self.given = connection, terrain, given
        self.mesh, self.token, self.size = Mesh(), "", 0

    def go(self, view):
        blob = increment(view, self.token, self.connection, self.terrain, **self.given)
        step = Increment(blob)
        if step.begins == Mesh().digest():
            self.mesh = Mesh()
        self.mesh = step.apply(self.mesh)
        self.token, self.size = step.token or self.token, len(blob)
        return step


def ulps(view, n):
    given = json.loads(view)
    given["eye"] = [math.nextafter(v, math.inf if n % 2 else -math.inf) for v in given["eye"]] if hasattr(math, "nextafter") else [
        v * (1 + (2**-52 if n % 2 else -2**-52)) for v in given["eye"]]
    given["yaw"] *= 1 + 2**-52
    return json.dumps(given)


def test_follow():
    for terrain, path in (("hills", lambda k: camera(200 + 3 * k, -900 + 2 * k, 300 - k, yaw=20 + k / 4)),
                          ("lonlat", lambda k: camera(10.2 + 0.001 * k, 46.1 + 0.0005 * k, 9000, yaw=20 + k / 4))):
        client, changes = Client(terrain=terrain), 0
        for k in range(40):
            before = client.token
            step = client.go(path(k))
            changes += bool(step.token)
            if k % 5 == 0 or k == 1:
                equal("%s, step %d: the client has the mesh that rows and files have" % (terrain, k), client.mesh == mesh_of(
                    path(k), terrain=terrain, previous=before), True)
            if not step.token:
                if not equal("%s: unchanged takes 48 bytes" % terrain, client.size, 48):
                    return
        check("%s: some steps change, some do not" % terrain, 3 < changes < 37, changes)


def test_jitter():
    client = Client()
    client.go(HERE)
    token, mesh = client.token, client.mesh
    same = all(client.go(ulps(HERE, n)).is_unchanged for n in range(50))
    check("F36_an_ulp_of_jitter_changes_nothing", same and client.token == token and client.mesh == mesh)
    for name, view in (("on a sample", camera(100, -300, float(GRID[30][10] or 0))), ("below ground", camera(300, -400, -50)),
                       ("far away", camera(1e7, -700, 1e7, pitch=-45, yaw=270))):
        client = Client()
        client.go(view)
        token = client.token
        check("F36_an_ulp_of_jitter_changes_nothing_%s" % name, all(client.go(ulps(view, n)).is_unchanged for n in range(6)) and client.token == token)
    equal("F36_nor_in_rows", rows(db, "SELECT *, token FROM rqt_view(?, 'hills', ?)", ulps(HERE, 1), options(previous=Client_token(HERE))),
          rows(db, "SELECT *, token FROM rqt_view(?, 'hills', ?)", HERE, options(previous=Client_token(HERE))))


def Client_token(view, terrain="hills", **given):
    return one(db, "SELECT token FROM rqt_view(?, ?, ?) LIMIT 1", view, terrain, options(previous="", **given))


def test_teleport():
    there = camera(900, -200, 120, yaw=250, pitch=-10)
    client, fresh = Client(), Client()
    client.go(HERE)
    client.go(there)
    fresh.go(there)
    check("F37_a_teleport_equals_a_fresh_query", client.mesh == fresh.mesh and client.token == fresh.token and len(fresh.mesh.vertices) > 10)
    equal("F37_in_rows_too", rows(db, "SELECT *, token FROM rqt_view(?, 'hills', ?)", there, options(previous=Client_token(HERE))),
          rows(db, "SELECT *, token FROM rqt_view(?, 'hills', ?)", there, options(previous="")))
    lens = camera(300, -700, 400, fovy=61)
    before = client.token
    check("another lens is another view", not client.go(lens).is_unchanged and client.token != before)


def test_other_connections():
    here, there = Client(), Client(connection=other)
    dice, same, blobs = s.Dice(9), True, True
    for k in range(12):
        view = camera(200 + dice.below(300), -900 + dice.below(300), 300, yaw=20 + dice.below(9))
        token, mesh = here.token, here.mesh
        blob = increment(view, token)
        # a connection that has never seen the token
        stranger = s.connect(BASE)
        blobs &= increment(view, token, stranger) == blob
        stranger.close()
        here.go(view)
        there.go(view)
        same &= here.token == there.token and here.mesh == there.mesh
    check("F37_tokens_mean_the_same_to_every_connection", same)
    check("F37_and_give_the_same_bytes", blobs)


def test_tokens():
    token = Client_token(HERE)
    check("a token is text", isinstance(token, str) and 100 < len(token) < 600, token)
    equal("without previous there is none", one(db, "SELECT token FROM rqt_view(?, 'hills') LIMIT 1", HERE), None)
    for table in ("rqt_view_triangles", "rqt_view_strip", "rqt_view_explain", "rqt_view"):
        equal("%s tells the same token" % table, one(db, "SELECT token FROM %s(?, 'hills', ?) LIMIT 1" % table, HERE, options(previous="")), token)
    wrong = "option \"previous\" is neither"
    for name, text in (("no token", "x"), ("cut off", token[:-1]), ("longer", token + "0"), ("another case", token.upper()),
                       ("one digit changed", token[:100] + ("0" if token[100] != "0" else "1") + token[101:])):
        raises("a token: " + name, wrong, lambda text=text: increment(HERE, text))
    raises("a token of another terrain", "the token is one of another terrain than flat", lambda: increment(HERE, token, terrain="flat"))
    raises("a token is text", "option \"previous\" must be a text", lambda: rows(db, "SELECT * FROM rqt_view(?, 'hills', '{\"previous\":1}')", HERE))
    raises("previous is for views", "option \"previous\" is for views", lambda: rows(db, "SELECT * FROM rqt_range(NULL, 1, 'hills', '{\"previous\":\"\"}')"))
    raises("an increment needs previous", "begins a sequence", lambda: one(db, "SELECT rqt_view_mesh(?, 'increment', 'hills')", HERE))
    raises("an increment is of a view", "is for views", lambda: one(db, "SELECT rqt_mesh(NULL, 1, 'increment', 'hills')"))
    raises("a test that promises nothing has no band", "option \"previous\" does not go with \"test\":\"sphere\"",
           lambda: rows(db, "SELECT * FROM rqt_view(?, 'hills', '{\"test\":\"sphere\",\"previous\":\"\"}')", HERE))
    step = Increment(increment(HERE, token, outline="exact"))
    check("other options are another answer, from nothing", not step.is_unchanged and step.frame is not None)
    forged = forge(token, {3: float("nan")})
    raises("a token with a camera that is none", "the token holds a camera that is none", lambda: increment(HERE, forged))
    far = forge(token, {3: 1e300, 4: -1e300})
    check("a token with an eye nowhere is harmless", not Increment(increment(HERE, far)).is_unchanged)


def forge(token, doubles):
    """What an enemy computes: numbers changed, the checksum made anew."""
    import struct
    words = list(struct.unpack("<26Q", bytes.fromhex(token[len("rqtv1-"):])))
    for n, value in doubles.items():
        words[n] = struct.unpack("<Q", struct.pack("<d", value))[0]
    mask, h = 2**64 - 1, 0x9E3779B97F4A7C15
    for w in words[:-1]:
        v = (h ^ w) * 0xC2B2AE3D27D4EB4F & mask
        h = (v << 29 | v >> 35) & mask
    h = (h ^ h >> 32) * 0xFF51AFD7ED558CCD & mask
    words[-1] = h ^ h >> 29
    return "rqtv1-" + struct.pack("<26Q", *words).hex()


def test_budget_follows():
    client = Client(max_triangles=300)
    client.go(HERE)
    check("a budget holds in a sequence", len(client.mesh.triangles) <= 300, len(client.mesh.triangles))
    check("and stays in the band", client.go(camera(301, -700, 400)).is_unchanged)
    token = client.token
    check("the tolerance it took goes along", one(db, "SELECT max(achieved_tau) FROM rqt_view(?, 'hills', ?)", camera(301, -700, 400),
                                                   options(previous=token, max_triangles=300)) > 2)


def test_other_state():
    path = s.temp("changed.gpkg")
    s.import_terrain(path, s.temp("hills.asc"), name="hills", block=4)
    one_more = s.connect(path)
    client = Client(connection=one_more)
    client.go(HERE)
    token, mesh = client.token, client.mesh
    changed = [row[:] for row in GRID]
    for j in range(40, 60):
        for i in range(30, 60):
            if changed[j][i] is not None:
                changed[j][i] += 37
    s.write_grid(s.temp("changed.asc"), changed, cell=10)
    said, status = s.run([s.RQT, "update", "--terrain", "hills", s.temp("changed.asc"), path])
    equal("the terrain is changed", status, 0) or print(said)
    step = client.go(HERE)
    fresh = Client(connection=one_more)
    fresh.go(HERE)
    check("a token of an older state gets a new answer", not step.is_unchanged and step.frame is not None and client.token != token)
    check("which is that of a fresh query", client.mesh == fresh.mesh and client.mesh != mesh)
    one_more.close()


def check_moves(name, found, least):
    """Each vertex is at its height, or in the middle of the edge between its parents as they were."""
    by_row = {r[0]: r for r in found}
    moving = [r for r in found if r[5] == 0]
    wrong = [r for r in found if (r[5] == 1) != (r[4] == r[3])]
    for _, a, b, _, z, _ in moving:
        if a in by_row and b in by_row and z != (by_row[a][4] + by_row[b][4]) / 2:
            wrong.append((a, b, z))
    check("F35_%s_z_from_is_z_or_the_middle_of_the_parents" % name, not wrong and len(moving) >= least, (wrong[:3], len(moving)))


def test_geomorph():
    columns = "SELECT rowid, parent_a, parent_b, z, z_from, weight FROM rqt_view(?, 'hills', ?)"
    check_moves("from twice the tau", rows(db, columns, HERE, None), 50)
    check_moves("with a budget", rows(db, columns, HERE, options(max_triangles=500)), 5)
    token = Client_token(HERE)
    check_moves("nothing has changed", rows(db, columns, HERE, options(previous=token)), 0)
    equal("F35_then_nothing_moves", {r[5] for r in rows(db, columns, HERE, options(previous=token))}, {1})
    there = camera(320, -660, 330)
    old = set(rows(db, "SELECT col, row FROM rqt_view(?, 'hills', ?)", HERE, options(previous=token)))
    found = rows(db, "SELECT col, row, weight, z = z_from FROM rqt_view(?, 'hills', ?)", there, options(previous=token))
    check_moves("from the last answer", rows(db, columns, there, options(previous=token)), 5)
    check("F35_what_was_there_stays", all(r[2] == 1 and r[3] for r in found if r[:2] in old))
    stranger = s.connect(BASE)
    equal("F35_for_any_connection", rows(stranger, columns, there, options(previous=token)), rows(db, columns, there, options(previous=token)))
    stranger.close()
    frame = camera(10.3, 46.2, 9000)
    equal("in a frame there is none", set(rows(db, "SELECT z_from, weight FROM rqt_view(?, 'lonlat', '{\"frame\":\"ecef\"}')", frame)), {(None, None)})


def test_band_is_right():
    """The promise for cameras of the band, by the verifier's projection when there is one: here, that the answer is never coarser than
    what the camera itself would get, as a set of vertices."""
    dice, seen, fine = s.Dice(11), 0, True
    for _ in range(30):
        anchor = camera(200 + dice.below(800), -900 + dice.below(800), 100 + dice.below(400), yaw=dice.below(360), pitch=-dice.below(80))
        token = Client_token(anchor)
        if token is None:
            continue
        given = json.loads(anchor)
        moved = dict(given, eye=[given["eye"][0] + dice.below(9) - 4, given["eye"][1] + dice.below(9) - 4, given["eye"][2] + dice.below(5) - 2],
                     yaw=given["yaw"] + dice.below(100) / 100)
        answer = rows(db, "SELECT token FROM rqt_view(?, 'hills', ?) LIMIT 1", json.dumps(moved), options(previous=token))
        if not answer or answer[0][0] != token:
            continue
        seen += 1
        mine = {(c, r): l for c, r, l in rows(db, "SELECT col, row, level FROM rqt_view(?, 'hills', ?)", json.dumps(moved), options(previous=token))}
        drawn = rows(db, "SELECT col, row FROM rqt_view(?, 'hills')", json.dumps(moved))
        missing = [v for v in drawn if v not in mine]
        fine &= len(missing) <= len(drawn) // 10
    check("cameras of the band", seen > 8 and fine, seen)


begun = time.time()
for test in (test_budgets, test_follow, test_jitter, test_teleport, test_other_connections, test_tokens, test_budget_follows,
             test_other_state, test_geomorph, test_band_is_right):
    test()
print("%.1f s" % (time.time() - begun))
s.finish()
