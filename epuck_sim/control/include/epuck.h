/* Firmware of simulated e-pucks. Names and units follow the e-puck library (gctronic.com) where it has them.

   A firmware is one C file: parameters, what a robot remembers, and two functions.

       #define PARAMETERS E_FLOAT(speed_cm_s, 6.0) E_INT(wait_steps, 40) E_BOOL(shy, true)
       #define MEMORY     E_INT(wait) E_FLOATS(past, 4)
       #include <epuck.h>

       void start(void) { memory->wait = e_randint(parameters->wait_steps); }
       void step(void)  { e_set_led(8, --memory->wait < 0); }

   Both lists come before the #include; either may be left out. `memory` is all zeros before `start`, which is called once
   for each robot; `step` is called in each control step. All robots run the same code in turns: a variable outside MEMORY
   would be shared by them, and is refused. An optional third function, `const char *check(void)`, returns NULL, or what is
   wrong with `parameters`, see `e_refuse`.

   There is no main(), no e_init_...() and no waiting: a step begins with new readings and ends at once. */

#ifndef EPUCK_H
#define EPUCK_H

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#ifndef PARAMETERS
#define PARAMETERS
#endif
#ifndef MEMORY
#define MEMORY
#endif

/* ---- what a robot knows: whole numbers are int64_t, others double, as in controllers in Python ---- */

#define E_FLOAT(name, ...) double name;
#define E_INT(name, ...) int64_t name;
#define E_BOOL(name, ...) int64_t name;
#define E_FLOATS(name, count) double name[count];
#define E_INTS(name, count) int64_t name[count];

typedef struct { PARAMETERS } e_parameters;
typedef struct { MEMORY } e_memory;

static _Thread_local const e_parameters *parameters; /* of the robot whose step is running */
static _Thread_local e_memory *memory;               /* of that robot, kept from step to step */

/* ---- the swarm, as the simulator lays it out ---- */

typedef struct {
    double left_cm_s, right_cm_s;
    int64_t ring; /* a bit for each LED */
    int64_t message;
    double turn_rad;
} e_actuators;

typedef struct {
    int64_t robots, pixels, memory_size, parameters_size; /* sizes in bytes */
    const int64_t *step_ms, *distance_mm, *camera;
    const double *infrared;
    const uint8_t *new_picture;
    const int64_t *pulses, *messages;
    e_actuators *actuators;
    char *memory;
    const char *parameters;
    uint64_t *random;
    volatile int64_t *serving; /* the robot whose step is running; -1 if none is */
    const uint8_t *present;    /* whether each robot is in the arena; last, as libraries of before know nothing of it */
} e_group;

static _Thread_local const e_group *e_swarm;
static _Thread_local int64_t e_robot;

/* ---- sensors; numbers from 0 to 7 are counted clockwise from front-right ---- */

#define E_SENSORS 8

/* Raw reading of a proximity sensor in counts; 0 for a number that no sensor has. */
static inline int e_get_prox(unsigned int number) {
    return number < E_SENSORS ? (int)e_swarm->infrared[e_robot * E_SENSORS + number] : 0;
}

/* The same: simulated sensors have no ambient light to be calibrated for. */
static inline int e_get_calibrated_prox(unsigned int number) { return e_get_prox(number); }

/* Distance in mm that belongs to the reading; 65535 where nothing is in range. Not in the e-puck library. */
static inline int e_get_distance_mm(unsigned int number) {
    return number < E_SENSORS ? (int)e_swarm->distance_mm[e_robot * E_SENSORS + number] : 65535;
}

/* Whether the picture of `e_get_red` is one that the robot has not seen before. */
static inline int e_poxxxx_is_img_ready(void) { return e_swarm->new_picture[e_robot]; }

/* Number of pixels in the camera's row. Not in the e-puck library. */
static inline int e_get_pixels(void) { return (int)e_swarm->pixels; }

/* 1 where the camera's row shows a lit ring, else 0; pixel 0 is the left edge. Not in the e-puck library. */
static inline int e_get_red(unsigned int pixel) {
    return pixel < (uint64_t)e_swarm->pixels ? (int)e_swarm->camera[e_robot * e_swarm->pixels + pixel] : 0;
}

/* Milliseconds of a control step on the robot's own clock. Not in the e-puck library. */
static inline int e_get_step_ms(void) { return (int)e_swarm->step_ms[e_robot]; }

/* Number of radio pulses that arrive in this step. Not in the e-puck library. */
static inline int e_get_pulses(void) { return (int)e_swarm->pulses[e_robot]; }

#define E_MESSAGES 8

/* What one of the first 8 of these pulses says; 0 for a ring that went on. Not in the e-puck library. */
static inline int64_t e_get_message(unsigned int number) {
    return number < E_MESSAGES ? e_swarm->messages[e_robot * E_MESSAGES + number] : 0;
}

/* ---- wheels, LEDs, message and turn keep what they are set to ---- */

/* A message, sent by radio in each step in which it is not 0. Not in the e-puck library. */
static inline void e_set_message(int64_t message) { e_swarm->actuators[e_robot].message = message; }

/* A turn on the spot in radians, to the left, at the beginning of each step. Not in the e-puck library. */
static inline void e_set_turn_rad(double turn) { e_swarm->actuators[e_robot].turn_rad = turn; }

#define E_MAX_STEPS 1000    /* of a wheel, in a second */
#define E_MAX_CM_S 12.8     /* the speed that belongs to it */

/* Speed of the left wheel in cm/s, up to 12.8 either way. Not in the e-puck library. */
static inline void e_set_speed_left_cm_s(double speed) { e_swarm->actuators[e_robot].left_cm_s = speed; }

/* Speed of the right wheel in cm/s, up to 12.8 either way. Not in the e-puck library. */
static inline void e_set_speed_right_cm_s(double speed) { e_swarm->actuators[e_robot].right_cm_s = speed; }

static inline double e_cm_s(int steps) {
    steps = steps > E_MAX_STEPS ? E_MAX_STEPS : steps < -E_MAX_STEPS ? -E_MAX_STEPS : steps;
    return steps * E_MAX_CM_S / E_MAX_STEPS;
}

/* Speed of a wheel in the motor's steps a second, up to 1000 either way: 12.8 cm/s. */
static inline void e_set_speed_left(int steps) { e_set_speed_left_cm_s(e_cm_s(steps)); }
static inline void e_set_speed_right(int steps) { e_set_speed_right_cm_s(e_cm_s(steps)); }

/* Set an LED of the ring: 0 is off, 1 on, anything else changes it; any number but 0 to 7 means all eight.
   Cameras see the ring as lit while at least one LED is. */
static inline void e_set_led(unsigned int number, unsigned int value) {
    int64_t *ring = &e_swarm->actuators[e_robot].ring, leds = number < 8 ? 1 << number : 0xff;
    *ring = value == 0 ? *ring & ~leds : value == 1 ? *ring | leds : *ring ^ leds;
}

static inline void e_led_clear(void) { e_set_led(8, 0); }

/* Nobody sees these two. */
static inline void e_set_body_led(unsigned int value) { (void)value; }
static inline void e_set_front_led(unsigned int value) { (void)value; }

/* ---- random numbers from the robot's own stream; rand() would be shared, and is refused ---- */

/* 64 random bits (xoshiro256++, Blackman and Vigna 2019). */
static inline uint64_t e_random_word(void) {
    uint64_t *random = e_swarm->random + 4 * e_robot;
    uint64_t total = random[0] + random[3], word = ((total << 23) | (total >> 41)) + random[0], shifted = random[1] << 17;
    random[2] ^= random[0];
    random[3] ^= random[1];
    random[1] ^= random[2];
    random[0] ^= random[3];
    random[2] ^= shifted;
    random[3] = (random[3] << 45) | (random[3] >> 19);
    return word;
}

/* A random number from [0, 1). */
static inline double e_uniform(void) { return (double)(e_random_word() >> 11) * (1.0 / 9007199254740992.0); }

/* A random whole number from 0 to limit - 1; limit is at most 2^31. */
static inline int64_t e_randint(int64_t limit) { return (int64_t)(e_uniform() * (double)limit); }

/* ---- what the simulator calls ---- */

void start(void);
void step(void);
__attribute__((weak)) const char *check(void);

static _Thread_local char e_refusal[200];

/* Make the message that `check` returns, as printf does: return e_refuse("speed_cm_s is %g; allowed: ...", ...). */
__attribute__((format(printf, 1, 2), unused)) static const char *e_refuse(const char *format, ...) {
    va_list values;
    va_start(values, format);
    vsnprintf(e_refusal, sizeof e_refusal, format, values);
    va_end(values);
    return e_refusal;
}

#define E_EXPORTED __attribute__((visibility("default"), used))

typedef struct {
    char name[64], kind; /* f, i or b */
    int64_t count;       /* 0 for a single number */
    int64_t offset;
    double value;
} e_field;

#undef E_FLOAT
#undef E_INT
#undef E_BOOL
#undef E_FLOATS
#undef E_INTS
#define E_FLOAT(name, ...) {#name, 'f', 0, offsetof(E_OWNER, name), (double)(__VA_ARGS__ + 0)},
#define E_INT(name, ...) {#name, 'i', 0, offsetof(E_OWNER, name), (double)(__VA_ARGS__ + 0)},
#define E_BOOL(name, ...) {#name, 'b', 0, offsetof(E_OWNER, name), (double)(__VA_ARGS__ + 0)},
#define E_FLOATS(name, count) {#name, 'f', count, offsetof(E_OWNER, name), 0},
#define E_INTS(name, count) {#name, 'i', count, offsetof(E_OWNER, name), 0},

E_EXPORTED const int64_t e_version = 1;
#define E_OWNER e_parameters
E_EXPORTED const e_field e_parameter_fields[] = {PARAMETERS{"", 0, 0, 0, 0}};
#undef E_OWNER
#define E_OWNER e_memory
E_EXPORTED const e_field e_memory_fields[] = {MEMORY{"", 0, 0, 0, 0}};

static inline void e_enter(const e_group *swarm, int64_t robot) {
    e_swarm = swarm;
    e_robot = *swarm->serving = robot;
    memory = (e_memory *)(swarm->memory + robot * swarm->memory_size);
    parameters = (const e_parameters *)(swarm->parameters + robot * swarm->parameters_size);
}

E_EXPORTED void e_start_all(const e_group *swarm) {
    for (int64_t robot = 0; robot < swarm->robots; robot++) {
        e_enter(swarm, robot);
        start();
    }
    *swarm->serving = -1;
}

E_EXPORTED void e_step_all(const e_group *swarm) {
    for (int64_t robot = 0; robot < swarm->robots; robot++) {
        if (!swarm->present[robot]) {
            continue;
        }
        e_enter(swarm, robot);
        step();
    }
    *swarm->serving = -1;
}

E_EXPORTED const char *e_check(const e_parameters *given) {
    parameters = given;
    return check ? check() : NULL;
}

#endif
