/* What kernels of a page call that is no kernel: numba's arrays and its helpers, and Chipmunk as `bodies/chipmunk.py` calls it. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#define EXPORT(name) __attribute__((export_name(#name))) name

/* --- numba's arrays: what counts their references, and the memory behind it --------------------------- */

typedef struct {
    int64_t references;
    void *destructor, *information, *data;
    int64_t size;
    void *allocator;
} Array;

void *NRT_MemInfo_alloc_aligned(int64_t size, int32_t alignment) {
    Array *array = malloc(sizeof(Array) + (size_t)size + (size_t)alignment);
    uintptr_t behind = (uintptr_t)(array + 1);
    *array = (Array){1, 0, 0, (void *)((behind + alignment - 1) / alignment * alignment), size, 0};
    return array;
}

void NRT_MemInfo_call_dtor(void *array) { free(array); }

/* Whether an array's elements are evenly spaced, so that it has another shape where it is; `min` and `max` ask so. */
int32_t numba_attempt_nocopy_reshape(int64_t axes, const int64_t *sizes, const int64_t *strides, int64_t new_axes,
                                     const int64_t *new_sizes, int64_t *new_strides, int64_t bytes, int32_t is_fortran) {
    int64_t stride = axes ? strides[axes - 1] : bytes, next = stride;
    for (int64_t axis = axes; axis-- > 0; next *= sizes[axis])
        if (is_fortran || strides[axis] != next) return 0;
    for (int64_t axis = new_axes; axis-- > 0; stride *= new_sizes[axis]) new_strides[axis] = stride;
    return 1;
}

/* --- what numba calls for a number's mantissa and exponent --------------------------------------------- */

double numba_ldexp(double number, int exponent) { return ldexp(number, exponent); }

double numba_frexp(double number, int *exponent) {
    *exponent = 0;
    return isfinite(number) && number != 0 ? frexp(number, exponent) : number;
}

void *EXPORT(take)(int size) { return calloc(1, size); }

#ifdef WITH_CHIPMUNK

#include "chipmunk/chipmunk_private.h"
#include "chipmunk/chipmunk_unsafe.h"

/* --- functions that kernels call: a struct is given as its numbers, and what is not asked for is not returned --- */

void EXPORT(call_cpSpaceAddBody)(cpSpace *space, cpBody *body) { cpSpaceAddBody(space, body); }
void EXPORT(call_cpSpaceAddShape)(cpSpace *space, cpShape *shape) { cpSpaceAddShape(space, shape); }
void EXPORT(call_cpBodySetPosition)(cpBody *body, double x, double y) { cpBodySetPosition(body, cpv(x, y)); }
void EXPORT(call_cpBodySetVelocity)(cpBody *body, double x, double y) { cpBodySetVelocity(body, cpv(x, y)); }

/* --- bodies and surfaces, as `bodies/shapes.py` makes them ------------------------------------------------ */

cpBody *EXPORT(make_ground)(void) { return cpBodyNewStatic(); }

cpBody *EXPORT(make_body)(double mass, double radius) {
    return cpBodyNew(mass, cpMomentForCircle(mass, 0, radius, cpvzero));
}

static cpShape *with_friction(cpShape *shape, double friction) {
    cpShapeSetFriction(shape, friction);
    return shape;
}

cpShape *EXPORT(make_disc)(cpBody *body, double x, double y, double radius, double friction) {
    return with_friction(cpCircleShapeNew(body, radius, cpv(x, y)), friction);
}

cpShape *EXPORT(make_polygon)(cpBody *body, int corners, cpVect *at, double radius, double friction) {
    return with_friction(cpPolyShapeNew(body, corners, at, cpTransformIdentity, radius), friction);
}

void EXPORT(pass_through)(cpShape *shape, int group) {
    cpShapeSetFilter(shape, cpShapeFilterNew(group, CP_ALL_CATEGORIES, CP_ALL_CATEGORIES));
}

/* pymunk prints what Chipmunk complains of; a page has nobody to read it */
void cpMessage(const char *condition, const char *file, int line, int is_error, int is_hard, const char *message, ...) {
    (void)condition, (void)file, (void)line, (void)is_hard, (void)message;
    if (is_error) abort();
}

#endif
