/* Create and free instances of an FMU's library: cycles LIBRARY VERSION TOKEN CYCLES.

   Each is initialized, set, stepped, saved, restored and freed. Exit code 1 for a failed call. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FRAME_s (1.0 / 120.0)

static void *library;

static void *function(const char *version, const char *name) {
    char whole[80];
    snprintf(whole, sizeof whole, "fmi%s%s", version, name);
    void *found = dlsym(library, whole);
    if (found == NULL) {
        fprintf(stderr, "no %s\n", whole);
        exit(1);
    }
    return found;
}

static void check(int status) {
    if (status != 0) {
        fprintf(stderr, "status %d\n", status);
        exit(1);
    }
}

int main(int count, char **words) {
    if (count != 5 || (library = dlopen(words[1], RTLD_NOW)) == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    const char *version = words[2], *token = words[3];
    const bool two = strcmp(version, "2") == 0;
    void *callbacks[5] = {NULL};
    uint32_t force = 1;
    double newton = 20.0;
    for (int i = 0; i < atoi(words[4]); i++) {
        void *one, *saved = NULL;
        if (two) {
            void *(*create)(const char *, int, const char *, const char *, void *, int, int) =
                function(version, "Instantiate");
            one = create("one", 1, token, "", callbacks, 0, 0);
            check(((int (*)(void *))function(version, "EnterInitializationMode"))(one));
        } else {
            void *(*create)(const char *, const char *, const char *, bool, bool, bool, bool,
                            const uint32_t *, size_t, void *, void *, void *) =
                function(version, "InstantiateCoSimulation");
            one = create("one", token, "", 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL);
            check(((int (*)(void *, bool, double, double, bool, double))function(
                version, "EnterInitializationMode"))(one, 0, 0.0, 0.0, 0, 0.0));
        }
        check(((int (*)(void *))function(version, "ExitInitializationMode"))(one));
        int (*set)(void *, const uint32_t *, size_t, const double *, size_t) =
            function(version, two ? "SetReal" : "SetFloat64");
        check(set(one, &force, 1, &newton, 1));
        const char *save = two ? "GetFMUstate" : "GetFMUState";
        check(((int (*)(void *, void **))function(version, save))(one, &saved));
        if (two) {
            check(((int (*)(void *, double, double, int))function(version, "DoStep"))(
                one, 0.0, FRAME_s, 1));
        } else {
            bool flags[3];
            double last;
            check(((int (*)(void *, double, double, bool, bool *, bool *, bool *, double *))
                       function(version, "DoStep"))(one, 0.0, FRAME_s, 1, flags, flags + 1,
                                                    flags + 2, &last));
        }
        const char *restore = two ? "SetFMUstate" : "SetFMUState";
        check(((int (*)(void *, void *))function(version, restore))(one, saved));
        const char *release = two ? "FreeFMUstate" : "FreeFMUState";
        check(((int (*)(void *, void **))function(version, release))(one, &saved));
        ((void (*)(void *))function(version, "FreeInstance"))(one);
    }
    return dlclose(library);
}
