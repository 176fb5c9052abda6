/* The controller `firefly` in C: Appendix B, and Algorithms 1 and 2, with the memory and the parameters that it has. */

#define PARAMETERS                       \
    E_FLOAT(speed_cm_s, 12.8)            \
    E_INT(proximity_threshold, 70)       \
    E_INT(proximity_count_threshold, 5)  \
    E_INT(rotation_max, 25)              \
    E_FLOAT(rotation_speed_cm_s, 12.8)   \
    E_FLOAT(period_s, 5.0)               \
    E_FLOAT(coupling, 0.1)               \
    E_FLOAT(flash_fraction, 0.075)       \
    E_FLOAT(refractory_fraction, 0.15)   \
    E_INT(delay_ms, 0)                   \
    E_INT(flash_pixels, 1)               \
    E_BOOL(once_per_sighting, false)

#define MEMORY              \
    E_INT(rotation_time)    \
    E_INT(proximity_count)  \
    E_FLOAT(left_mm_s)      \
    E_FLOAT(right_mm_s)     \
    E_INT(phase_ms)         \
    E_INT(flash_seen)

#include <epuck.h>
#include <stdlib.h>

static int64_t whole_ms(double seconds) { return (int64_t)(seconds * 1000 + 1e-6); }

const char *check(void) {
    if (!(parameters->speed_cm_s >= 0 && parameters->speed_cm_s <= 12.8))
        return e_refuse("speed_cm_s is %g; allowed: 0 to 12.8, the wheels' limit", parameters->speed_cm_s);
    return NULL;
}

void start(void) { memory->phase_ms = e_randint(whole_ms(parameters->period_s)); }

/* ---- Appendix B ---- */

static const int ANGLE_X[8] = {96, 70, 0, -88, -88, 0, 70, 96};
static const int ANGLE_Y[8] = {30, 72, 100, 48, -48, -100, -72, -30};

static double halved(double speed) { return (double)(int64_t)(speed / 2); }

static void move(void) {
    int64_t x = 0, y = 0, threshold = parameters->proximity_threshold;
    for (int i = 5; i < 11; i++) {
        int sensor = i % 8, mm = e_get_distance_mm(sensor), near = mm > 100 ? 0 : 100 - mm;
        if (near > threshold) {
            x += near * ANGLE_X[sensor] / 100;
            y += near * ANGLE_Y[sensor] / 100;
        }
    }
    int64_t turn = (int64_t)(parameters->rotation_speed_cm_s * 10 + 0.5), direction = y > 0 ? 1 : -1;
    if (memory->rotation_time > 0 || memory->proximity_count > 0) {
        if (llabs(x) > threshold || llabs(y) > threshold)
            memory->proximity_count++;
        else
            memory->proximity_count = 0;
    }
    if (memory->proximity_count > parameters->proximity_count_threshold) {
        memory->left_mm_s = -turn * direction;
        memory->right_mm_s = turn * direction;
        memory->rotation_time += 1 + e_randint(parameters->rotation_max);
        memory->proximity_count = 0;
    }
    if (x > threshold) {
        if (memory->proximity_count == 0) {
            memory->left_mm_s = -turn * direction;
            memory->right_mm_s = turn * direction;
        } else {
            memory->left_mm_s = halved(memory->left_mm_s) - turn * direction / 2;
            memory->right_mm_s = halved(memory->right_mm_s) + turn * direction / 2;
        }
        memory->rotation_time = 1;
    } else if (memory->rotation_time == 0) {
        memory->left_mm_s = memory->right_mm_s = parameters->speed_cm_s * 10;
    } else {
        memory->rotation_time--;
    }
    e_set_speed_left_cm_s(memory->left_mm_s / 10);
    e_set_speed_right_cm_s(memory->right_mm_s / 10);
}

/* ---- Algorithms 1 and 2 ---- */

#define PARTS 1000000

static void flash(void) {
    int64_t period = whole_ms(parameters->period_s), refractory = whole_ms(parameters->refractory_fraction * parameters->period_s);
    int64_t red = 0;
    for (int pixel = 0; pixel < e_get_pixels(); pixel++)
        red += e_get_red(pixel);
    bool seen = red >= parameters->flash_pixels;
    bool acts = seen && e_poxxxx_is_img_ready() && !(parameters->once_per_sighting && memory->flash_seen);
    memory->flash_seen = seen;

    int64_t phase = memory->phase_ms + e_get_step_ms();
    if (phase > refractory && acts) {
        phase -= parameters->delay_ms;
        if (phase > refractory)
            phase = phase * (PARTS + (int64_t)(parameters->coupling * PARTS + 0.5)) / PARTS;
        if (phase > period) {
            phase = 0;
            e_set_led(8, 1);
        }
        phase += parameters->delay_ms;
    }
    if (phase >= period) {
        phase = 0;
        e_set_led(8, 1);
    }
    if (phase > whole_ms(parameters->flash_fraction * parameters->period_s))
        e_led_clear();
    memory->phase_ms = phase;
}

void step(void) {
    move();
    flash();
}
