/* A loader's end of the open protocol between coupled and a control loader, version 1.
 *
 * C99, no heap, no operating system: it parses received bytes and writes bytes to send. Copy
 * this file. All numbers of the wire are little-endian; floats are IEEE 754 of 32 bits, SI.
 *
 *     coupled_loader loader;
 *     coupled_init(&loader, 1);
 *     ... on a datagram:  if (coupled_take(&loader, bytes, size, now_us)) { measure; n =
 *                             coupled_state(&loader, measured, out, now_us); send(out, n); }
 *     ... each loader step: const coupled_order *o = coupled_orders(&loader, now_us);
 *                             F_mod = coupled_force(&o[0], computed);
 *
 * Without a packet for 100 ms, or if the mode of the host is "off", the orders are zero.
 */
#ifndef COUPLED_LOADER_H
#define COUPLED_LOADER_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define COUPLED_VERSION 1
#define COUPLED_MOST_CONTROLS 3
#define COUPLED_WATCHDOG_us 100000u
#define COUPLED_HEADER_bytes 28u
#define COUPLED_LARGEST_bytes (COUPLED_HEADER_bytes + 3u * 28u + 4u)

enum { COUPLED_STATE = 1, COUPLED_ORDER = 2 };
enum { COUPLED_RUN = 1, COUPLED_FADING = 2, COUPLED_OFF = 3 };

typedef struct {
    float force_N, computed, deflection; /* deflection: NAN where it is not measured */
} coupled_measured;

typedef struct {
    float gradient, second, break_at, breakout_N, force_N, total, trim;
} coupled_order;

typedef struct {
    int controls;
    uint8_t mode;
    int heard;
    uint32_t session, last, sequence, dropped;
    uint64_t heard_us;
    coupled_order orders[COUPLED_MOST_CONTROLS];
} coupled_loader;

static uint32_t coupled_get32(const uint8_t *at) {
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void coupled_put32(uint8_t *at, uint32_t value) {
    for (int i = 0; i < 4; i++) at[i] = (uint8_t)(value >> (8 * i));
}

static float coupled_get_float(const uint8_t *at) {
    uint32_t bits = coupled_get32(at);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void coupled_put_float(uint8_t *at, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    coupled_put32(at, bits);
}

/* CRC-32 of IEEE 802.3, reflected, 0xEDB88320. */
static uint32_t coupled_crc(const uint8_t *bytes, size_t size) {
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

static void coupled_init(coupled_loader *loader, int controls) {
    memset(loader, 0, sizeof *loader);
    loader->controls = controls;
    loader->mode = COUPLED_OFF;
}

static int coupled_quiet(const coupled_loader *loader, uint64_t now_us) {
    return !loader->heard || now_us - loader->heard_us > COUPLED_WATCHDOG_us;
}

/* Parses a datagram of the host; returns 1 if it is valid and new, and must be answered. */
static int coupled_take(coupled_loader *loader, const uint8_t *bytes, size_t size,
                        uint64_t now_us) {
    size_t wanted = COUPLED_HEADER_bytes + 28u * (size_t)loader->controls + 4u;
    uint32_t session, sequence;
    coupled_order orders[COUPLED_MOST_CONTROLS];
    loader->dropped++;
    if (size != wanted || memcmp(bytes, "CPLD", 4) != 0 || bytes[4] != COUPLED_VERSION) return 0;
    if (bytes[5] != COUPLED_ORDER || bytes[6] != loader->controls) return 0;
    if (bytes[7] < COUPLED_RUN || bytes[7] > COUPLED_OFF) return 0;
    if (coupled_crc(bytes, size - 4) != coupled_get32(bytes + size - 4)) return 0;
    session = coupled_get32(bytes + 8);
    sequence = coupled_get32(bytes + 12);
    if (loader->heard && session == loader->session) {
        uint32_t ahead = sequence - loader->last;
        if (ahead == 0 || ahead >= 0x80000000u) return 0; /* replayed or late */
    } else if (!coupled_quiet(loader, now_us) && loader->mode != COUPLED_OFF) {
        return 0; /* another host, while one is flying */
    }
    for (int i = 0; i < loader->controls; i++) {
        const uint8_t *at = bytes + COUPLED_HEADER_bytes + 28u * (size_t)i;
        float *value = &orders[i].gradient;
        for (int j = 0; j < 7; j++) {
            value[j] = coupled_get_float(at + 4 * j);
            if (!(value[j] - value[j] == 0.0f)) return 0; /* infinite, or no number */
        }
    }
    memcpy(loader->orders, orders, sizeof orders[0] * (size_t)loader->controls);
    loader->session = session;
    loader->last = sequence;
    loader->mode = bytes[7];
    loader->heard = 1;
    loader->heard_us = now_us;
    loader->dropped--;
    return 1;
}

/* Returns the current orders, one per control; zero if the host is silent or off. */
static const coupled_order *coupled_orders(coupled_loader *loader, uint64_t now_us) {
    if (coupled_quiet(loader, now_us) || loader->mode == COUPLED_OFF)
        memset(loader->orders, 0, sizeof loader->orders);
    return loader->orders;
}

/* Returns F_mod in N at a deflection, as an analog multiplier with these orders gives it. */
static float coupled_force(const coupled_order *order, float computed) {
    float force = order->gradient * computed;
    float size = computed < 0.0f ? -computed : computed;
    float sign = computed > 0.0f ? 1.0f : computed < 0.0f ? -1.0f : 0.0f;
    if (order->break_at > 0.0f && size > order->break_at)
        force += sign * (order->second - order->gradient) * (size - order->break_at);
    return force + sign * order->breakout_N;
}

/* Writes the answer into `out`, of at least COUPLED_LARGEST_bytes; returns its size. */
static size_t coupled_state(coupled_loader *loader, const coupled_measured *measured,
                            uint8_t *out, uint64_t now_us) {
    size_t size = COUPLED_HEADER_bytes;
    memcpy(out, "CPLD", 4);
    out[4] = COUPLED_VERSION;
    out[5] = COUPLED_STATE;
    out[6] = (uint8_t)loader->controls;
    out[7] = loader->mode;
    coupled_put32(out + 8, loader->session);
    coupled_put32(out + 12, ++loader->sequence);
    coupled_put32(out + 16, loader->last);
    coupled_put32(out + 20, (uint32_t)now_us);
    coupled_put32(out + 24, (uint32_t)(now_us >> 32));
    for (int i = 0; i < loader->controls; i++) {
        coupled_put_float(out + size, measured[i].force_N);
        coupled_put_float(out + size + 4, measured[i].computed);
        coupled_put_float(out + size + 8, measured[i].deflection);
        size += 12;
    }
    coupled_put32(out + size, coupled_crc(out, size));
    return size + 4;
}

#endif
