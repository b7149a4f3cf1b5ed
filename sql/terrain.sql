-- The tables of terrain {N}. id: 4^level + Morton code of the block's cell. summary, data: src/core/FORMAT.md.
CREATE TABLE rqt_block_{N} (
  id INTEGER PRIMARY KEY,
  summary BLOB NOT NULL,
  data BLOB NOT NULL
);
-- Extent in samples, and the closed intervals of error codes in which the block answers: outline `tol`, outline `exact`.
CREATE VIRTUAL TABLE rqt_index_{N} USING rtree_i32(
  id, x0, x1, y0, y1, tol0, tol1, exact0, exact1
);
