"""Mutants of what is stored and sent: blocks, formats, memory: see ../mutants.py."""

MUTANTS = [
    # stored bytes
    ("bytes: the checksum is not compared", "src/core/block_codec.c", "checksum64(bytes, size, AT_CHECKSUM)",
     "get64(bytes + AT_CHECKSUM)", "test_codec_block", "every_flipped_bit_of_a_block_is_noticed"),
    ("bytes: a short payload passes", "src/core/block_codec.c", "if (got != h->payload)", "if (got < h->payload)",
     "test_codec_block", "a_payload_that_lies_is_found_out_under_a_good_checksum"),
    ("bytes: the predictor slips by half a step", "src/core/block_predict.c", "0.5 - 0x1p-21", "0.5",
     "test_codec_format", "the_bytes_of_a_block_mean_what_the_format_says"),
    ("bytes: a sparse block drops what it must keep", "src/core/block_sparse.c", "(uint8_t)((b->error[i] > b->floor)",
     "(uint8_t)((b->error[i] > b->floor + 1)", "test_codec_block", "a_sparse_block_comes_back_as_far_as_it_is_kept"),
    ("bytes: a kept vertex needs no reason", "src/core/block_sparse.c", "*good &= outline | (own > e->floor);", "(void)good;",
     "test_codec_block", "a_payload_that_lies_is_found_out_under_a_good_checksum"),
    ("bytes: a sparse block's bits may be too many", "src/core/block_sparse.c", "return (list->offered + 7) / 8 == bytes &&",
     "return (list->offered + 7) / 8 <= bytes &&", "test_codec_block",
     "a_payload_that_lies_is_found_out_under_a_good_checksum"),
    ("pyramid: the floor is the parent's", "src/core/pyramid.c", "block->floor = block->sparse ? b->em : 0;",
     "block->floor = block->sparse ? summary->tol.em_parent : 0;", "test_core_query",
     "blocks_and_summaries_hold_what_the_oracle_says"),
    ("check: a vertex that a parent must keep", "src/store/check.c",
     "if ((kept || kept_there) && error > floor) count(&d->errors, at);", "(void)error, (void)floor;", "test_store",
     "every_damage_is_found_where_it_is"),
    # memory
    ("memory: a refused allocation passes for done", "src/core/selection.c", "if (!slot) return RQT_NO_MEMORY;",
     "if (!slot) return RQT_OK;", "test_core_memory", "one_refused_allocation_is_reported_and_nothing_leaks"),
    # the wire format
    ("wire: a leaf begins at the apex of the one before", "src/core/wire_walk.c",
     "il = ir;", "il = ia;",
     "test_wire", "the_patch_of_the_query_comes_back_in_its_order"),
    ("wire: an increment of any mesh is taken", "src/core/wire_decode.c",
     "if (rqt_wire_digest(patch) != from)", "if (from == 0)",
     "test_wire", "increments_that_belong_elsewhere_are_refused_with_a_reason"),
    ("wire: heights beyond the limit", "src/core/wire_decode.c",
     "r->bad |= !(q > -RQT_HEIGHT_LIMIT && q < RQT_HEIGHT_LIMIT);", "r->bad |= q == INT64_MIN;",
     "test_wire", "hostile_bytes_are_refused_or_harmless"),
]
