// samples.mjs - a mesh over a raster: its height at every sample.

/**
 * Calls see(column, row, height) for every sample that a triangle covers, for each such triangle.
 *
 * @param {{x: number[], y: number[], z: number[], triangles: number[]}} mesh x and y in samples, y down; triangles: three vertices each
 * @param {number} columns, rows of the raster
 */
export function heightsUnder({x, y, z, triangles}, columns, rows, see) {
    for (let i = 0; i < triangles.length; i += 3) {
        const a = triangles[i], b = triangles[i + 1], c = triangles[i + 2], xa = x[a], ya = y[a], xb = x[b], yb = y[b], xc = x[c], yc = y[c];
        const area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya);
        if (area === 0) continue;
        const last = Math.min(rows - 1, Math.floor(Math.max(ya, yb, yc))), right = Math.min(columns - 1, Math.floor(Math.max(xa, xb, xc)));
        for (let row = Math.max(0, Math.ceil(Math.min(ya, yb, yc))); row <= last; row++)
            for (let col = Math.max(0, Math.ceil(Math.min(xa, xb, xc))); col <= right; col++) {
                const wb = ((col - xa) * (yc - ya) - (xc - xa) * (row - ya)) / area, wc = ((xb - xa) * (row - ya) - (col - xa) * (yb - ya)) / area;
                if (wb >= -1e-9 && wc >= -1e-9 && wb + wc <= 1 + 1e-9) see(col, row, (1 - wb - wc) * z[a] + wb * z[b] + wc * z[c]);
            }
    }
}
