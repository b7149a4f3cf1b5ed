"""Mutants of what the page reads: meshes in wire format, increments, geomorphs, places; see ../mutants.py."""

WIRE, HOSTILE, INCREMENT, MORPH, PLACE = ("web/%s.test.mjs" % name for name in ("wire", "hostile", "increment", "morph", "place"))
SAME, SPOILED, STEPS = "every mesh is the C decoder", "20,000 spoiled meshes", "20 cameras"

MUTANTS = [
    ("page: a mean is rounded to nothing", "src/web/wire_walk.js", "+ ((qa & 3) + (qb & 3) + (qc & 3) + (qd & 3) >> 2)", "", WIRE, SAME),
    ("page: the rim's samples are not shared", "src/web/wire_walk.js", "if (rim && this.slotHas[slot]) {", "if (rim && this.slotHas[slot] && !slot) {", WIRE, SAME),
    ("page: an orientation for all depths", "src/web/wire_walk.js", "this.addLeaf(a, l, r, turn ^ splits & 1)", "this.addLeaf(a, l, r, turn)", WIRE, SAME),
    ("page: a block leaves its vertices behind", "src/web/wire_walk.js", "this.memo[this.touched[i]] = NONE;", "this.memo[this.touched[i]] = this.touched[i] % 7 ? NONE : CHOSEN;",
     WIRE, SAME),
    ("page: normals are not sums", "src/web/wire.js", "at += planes[plane * count + i];", "at = planes[plane * count + i];", WIRE, SAME),
    ("page: errors have no children", "src/web/wire_errors.js", "codes[table.index[parent]] = code;", "continue;", WIRE, SAME),
    ("page: an increment of a mesh knows no sample", "src/web/wire.js", "if (prior.find(mesh.col[i], mesh.row[i]) < 0) prior.add(mesh.col[i], mesh.row[i], mesh.q[i], 0);", "",
     WIRE, "increments of rqt_delta"),
    ("page: streams may have bits left", "src/web/wire_walk.js", "at[i] % 8 && this.payload[begin[i] + Math.floor(at[i] / 8)] >> at[i] % 8) bad();", "at[i] < 0) bad();", HOSTILE, SPOILED),
    ("page: heights without a limit", "src/web/wire_walk.js", "if (!(q > -HEIGHT_LIMIT && q < HEIGHT_LIMIT)) bad();", "", HOSTILE, SPOILED),
    ("page: all that a header claims is taken", "src/web/wire_walk.js", "Math.min(2 * (count + more), most + more)", "most + 2 ** 26", HOSTILE, "no more memory"),
    ("page: matches are copied unseen", "src/web/zstd.js", "|| length + match > stop - at ", "", HOSTILE, "spoiled frames"),
    ("page: sequences may leave bits over", "src/web/zstd.js", "if (pos !== 0) bad();", "", HOSTILE, "spoiled frames"),
    ("page: an increment of anything", "src/web/increment.js", "if (!isSame(digestOf(old), header.from))", "if (false)", INCREMENT, "another mesh is refused"),
    ("page: what goes by name stays", "src/web/increment.js", "if (goes[t] || now[0] === GONE", "if (now[0] === GONE", INCREMENT, STEPS),
    ("page: heights go by the old order", "src/web/increment.js", "before = q[n];", "before = k ? q[n] : before;", INCREMENT, STEPS),
    ("morph: no vertex is between two others", "src/web/morph.js", "(z[left] + z[right]) / 2 : own", "z[left] : own", MORPH, "at every sample"),
    ("morph: clamped vertices move", "src/web/morph.js", "this.isNearEnd(this.x[v], this.y[v]) ? this.ownHeight(v) : NaN", "NaN", MORPH, "have their own heights"),
    ("morph: the set is not closed", "src/web/morph.js", "if (!isWhole || this.isClamped) this.closeSet", "if (0) this.closeSet", MORPH, "at every sample"),
    ("morph: all leaves are kept", "src/web/morph.js", "if (!isWhole) this.kept[m] = leavesByApex(mesh);", "", MORPH, "at every sample"),
    ("places: the exaggeration comes too late", "src/web/place.js", "h = metresOf(mesh, heights[i]) * this.exaggeration;", "h = metresOf(mesh, heights[i]);", PLACE, "exaggerated"),
    ("places: a sphere", "src/web/place.js", "(n * (1 - e2) + h) * sp];", "(n + h) * sp];", PLACE, "where SQL puts them"),
]
