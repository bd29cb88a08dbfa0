// SPDX-License-Identifier: BSD-3-Clause
// The world of the fault campaign: one clock that nobody waits for, the controller's machine, and what goes wrong.
//
// Everything that the real drivers reach beyond this process ends here: the serial line (line.c), USB (usb.c), the
// camera (camera.c), the disk (disk.c) and the clock (clock.c). It lives in memory that survives the host's process, as
// a rig survives its computer's crash, and follows from the seed alone.
#ifndef GONIO_TESTS_FAULTS_WORLD_H
#define GONIO_TESTS_FAULTS_WORLD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "firmware/board/posix/machine.h"
#include "gonio/rig.h"
#include "gonio/session.h"

// What a fault's moment is counted in.
typedef enum unit { EXCHANGES, TIME_US, USB_TRANSFERS, FRAMES, DISK_WRITES, UNITS } unit;

// X(name, unit, area)
#define FAULT_KINDS(X)                                                                                                 \
    X(reply_delayed, EXCHANGES, "Modbus")                                                                              \
    X(request_dropped, EXCHANGES, "Modbus")                                                                            \
    X(reply_dropped, EXCHANGES, "Modbus")                                                                              \
    X(request_bit_flipped, EXCHANGES, "Modbus")                                                                        \
    X(reply_bit_flipped, EXCHANGES, "Modbus")                                                                          \
    X(request_split, EXCHANGES, "Modbus")                                                                              \
    X(reply_split, EXCHANGES, "Modbus")                                                                                \
    X(replies_merged, EXCHANGES, "Modbus")                                                                             \
    X(stale_reply, EXCHANGES, "Modbus")                                                                                \
    X(line_noise, EXCHANGES, "Modbus")                                                                                 \
    X(reply_cut, EXCHANGES, "Modbus")                                                                                  \
    X(busy_exception, EXCHANGES, "Modbus")                                                                             \
    X(line_closed, EXCHANGES, "Modbus")                                                                                \
    X(line_dead, TIME_US, "Modbus")                                                                                    \
    X(line_echo, TIME_US, "Modbus")                                                                                    \
    X(second_master, TIME_US, "Modbus")                                                                                \
    X(adapter_unplugged, TIME_US, "Modbus")                                                                            \
    X(home_switch_missing, TIME_US, "motion")                                                                          \
    X(home_switch_stuck, TIME_US, "motion")                                                                            \
    X(home_switch_pressed, TIME_US, "motion")                                                                          \
    X(home_switch_bouncing, TIME_US, "motion")                                                                         \
    X(steps_lost, TIME_US, "motion")                                                                                   \
    X(steps_lost_encoder, TIME_US, "motion")                                                                           \
    X(encoder_silent, TIME_US, "motion")                                                                               \
    X(encoder_frozen, TIME_US, "motion")                                                                               \
    X(emergency_stop, TIME_US, "motion")                                                                               \
    X(door_opened, TIME_US, "motion")                                                                                  \
    X(limit_switch, TIME_US, "motion")                                                                                 \
    X(controller_brown_out, TIME_US, "motion")                                                                         \
    X(controller_hangs, TIME_US, "motion")                                                                             \
    X(controller_reset, TIME_US, "motion")                                                                             \
    X(lamp_too_hot, TIME_US, "motion")                                                                                 \
    X(lamp_sensor_broken, TIME_US, "motion")                                                                           \
    X(usb_stall, USB_TRANSFERS, "USB")                                                                                 \
    X(usb_silent, USB_TRANSFERS, "USB")                                                                                \
    X(usb_reply_short, USB_TRANSFERS, "USB")                                                                           \
    X(usb_reply_stale, USB_TRANSFERS, "USB")                                                                           \
    X(usb_reply_garbage, USB_TRANSFERS, "USB")                                                                         \
    X(usb_clear_fails, USB_TRANSFERS, "USB")                                                                           \
    X(usb_unplugged, TIME_US, "USB")                                                                                   \
    X(frame_dropped, FRAMES, "camera")                                                                                 \
    X(frame_damaged, FRAMES, "camera")                                                                                 \
    X(frame_short, FRAMES, "camera")                                                                                   \
    X(camera_silent, TIME_US, "camera")                                                                                \
    X(camera_unplugged, TIME_US, "camera")                                                                             \
    X(exposure_stuck, TIME_US, "camera")                                                                               \
    X(frame_late, FRAMES, "camera")                                                                                    \
    X(uvc_stamps, TIME_US, "camera")                                                                                   \
    X(host_killed_writing, DISK_WRITES, "host")                                                                        \
    X(host_killed, TIME_US, "host")                                                                                    \
    X(host_power_cut, DISK_WRITES, "host")                                                                             \
    X(power_cut, DISK_WRITES, "host")                                                                                  \
    X(disk_full, DISK_WRITES, "host")                                                                                  \
    X(disk_error, DISK_WRITES, "host")                                                                                 \
    X(ctrl_c, TIME_US, "host")                                                                                         \
    X(rig_file_edited, TIME_US, "host")

typedef enum fault_kind {
#define X(name, unit, area) FAULT_##name,
    FAULT_KINDS(X)
#undef X
        FAULT_COUNT
} fault_kind;

typedef struct fault_info {
    const char *name, *area;
    unit unit;
} fault_info;
extern const fault_info fault_infos[FAULT_COUNT];

typedef struct fault {
    fault_kind kind;
    int64_t at;          // in the kind's unit
    int64_t duration_us; // of those that last
    int burst;           // of those that strike single things: so many of them
    uint32_t parameter;
    int64_t until_us;
    int used;
    bool standing, over, homing_seen;
    int64_t hits; // how often it really did something
} fault;

enum { FAULTS_MAX = 2, SERIAL_MAX = 8192, OLD_MAX = 512 };

typedef struct serial_byte {
    int64_t at_us;
    uint8_t byte;
} serial_byte;

typedef struct world {
    int64_t now_us;
    struct machine machine;
    bool controller_off; // without power
    uint64_t random;
    fault faults[FAULTS_MAX];
    int n;
    int64_t counts[UNITS];
    // line
    serial_byte incoming[SERIAL_MAX];
    int head, tail;
    uint8_t held[OLD_MAX], old[OLD_MAX];
    int held_n, old_n;
    bool line_broken;
    bool encoders;           // there are some, of which these stand still at
    int64_t frozen[FW_AXES]; // steps
    // invariants
    int64_t past_limit, moved_alone;
    int64_t spoke_us;     // the second master
    uint64_t stepped_us;  // the machine's time of its last step
    int64_t slip_allowed; // steps
    int64_t homing_us;    // when it last was homing
    bool slip_seen;       // steps were lost where encoders had to find it at that very pose
    int taken_back;       // audits that took steps back
    // this host's
    bool host_runs, interrupted;
    int64_t host_started_us, host_bound_us;
    bool verbose;
    // what the host says
    gonio_status status;
    char message[512], sha256[GONIO_SHA256_HEX];
    bool finished;
    long long samples;
    char trouble[1024]; // what must not be: the campaign's finding
    char folder[128];
} world;

extern world *w;

// After a move the arms swing for as long as the controller (50 ms) and the scan wait.
enum { SETTLE_US = 100000, SWING_US = 50000 + SETTLE_US };

// ---- world.c ----
uint32_t world_random(void);
void world_pass(int64_t us);
// The scheduled fault of that kind if it strikes now (single things: counts it as used); NULL: it does not.
fault *world_strikes(fault_kind kind);
// Whether a single fault of that kind waits for its occasion.
bool world_waits(fault_kind kind);
// Whether a lasting fault of that kind stands; counts a hit.
bool world_stands(fault_kind kind);
void world_new(uint64_t seed);
// Another program, with another rig file, while none measures: it writes its parameters and goes.
void world_visit(void);
// What the encoder of an axis counts.
int64_t world_encoder(int axis);
void world_repair(void); // every fault that has struck is over
void world_trouble(const char *format, ...) __attribute__((format(printf, 1, 2)));
// Let the drivers' own thread have its turn (clock.c).
void clock_turn(void);
void clock_forget_threads(void);

// ---- camera.c, usb.c, host.c ----
#include "host/transport/v4l2.h"
extern const gonio_v4l2_io camera_model_io;
void camera_model_reset(void);
// Renders the frame that the stamp of the capture under way describes, full frame, Y16.
extern void (*camera_render)(double exposure_s, uint16_t *pixels);
extern int64_t camera_asked_us; // frames begun before this are older than the capture
// The value of the meter at the stamp of the reading under way.
extern double (*usb_power)(void);
void usb_model_reset(void);
enum { CAMERA_WIDTH = 44, CAMERA_HEIGHT = 44 };

// Measure or go on, as `gonio measure` and `gonio resume` do; fills w->status and what follows.
void host_run(void);
// Is the session on disk sound, as `gonio doctor` sees it? Fills w->trouble where it is not.
void host_doctor(void);

#endif
