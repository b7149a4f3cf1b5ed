/* test_core_field.c - an eps for every square of a field, against its definition: test_core_trial.h. */
#include "test_core_trial.h"

static void fields_equal_their_definition_on_small_rasters(void **state) {
    (void)state;
    random_begin("small fields");
    for (int n = 0; n < 200; n++) {
        trial *t = trial_create(random_between(1, 12), random_between(1, 12), n % 4 == 3);
        if (n % 2) t->places = 0;
        if (n % 3) t->forced_count = 0;
        if (n % 3 != 1) t->eps = n % 2 ? INFINITY : 1e12;
        if (n % 5 == 0) t->factor = random_unit() + 0.5;
        give_field(t, 1, random_between(30, 100));
        check_trial(t);
        trial_free(t);
    }
}

static void fields_equal_their_definition_on_larger_rasters(void **state) {
    (void)state;
    random_begin("larger fields");
    for (int n = 0; n < 16; n++) {
        trial *t = trial_create(random_between(17, 40), random_between(17, 40), 0);
        if (n % 4) t->places = t->forced_count = 0;
        t->eps = INFINITY;
        give_field(t, 1 << random_between(0, 3), random_between(50, 100));
        check_trial(t);
        trial_free(t);
    }
}

int main(void) {
    random_announce();
    const struct CMUnitTest tests[] = {
        TEST(fields_equal_their_definition_on_small_rasters),
        TEST(fields_equal_their_definition_on_larger_rasters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
