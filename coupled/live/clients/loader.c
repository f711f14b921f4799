/* An example loader with the open protocol, for any system with BSD sockets:
 *
 *     cc -std=c99 -O2 -o loader loader.c -lm && ./loader 5760
 *
 * It simulates one control, m·x'' + c·x' + G·x + F_mod = F, moved by a hand of 20 N at 0.4 Hz that
 * begins 2 s after the host's forces are on. It steps a 120th of a second for each packet of the
 * host, so that a host in lock-step can run at any speed. On a microcontroller, keep
 * coupled_loader.h and replace `advance` by your own converters.
 */
#define _POSIX_C_SOURCE 200809L

#include <arpa/inet.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "coupled_loader.h"

#define FRAME_s (1.0 / 120.0)
#define SUBSTEPS 17

static const double MASS_kg = 4.0, DAMPING = 75.0, BASIC_N_per_m = 560.4;
static const double BEND_m_per_N = 9.136e-5, HAND_N = 20.0, HAND_Hz = 0.4;

static uint64_t now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

typedef struct {
    double time, x, v, force;
} control;

static void advance(control *c, const coupled_order *order) {
    const double h = FRAME_s / SUBSTEPS, turn = 6.283185307179586;
    for (int i = 0; i < SUBSTEPS; i++) {
        double begun = c->time - 2.0;
        c->force = begun > 0.0 ? HAND_N * sin(turn * HAND_Hz * begun) : 0.0;
        double net = c->force - DAMPING * c->v - BASIC_N_per_m * c->x;
        c->v += h * (net - coupled_force(order, (float)c->x)) / MASS_kg;
        c->x += h * c->v;
        c->time += h;
    }
}

int main(int count, char **words) {
    struct sockaddr_in here = {.sin_family = AF_INET}, host;
    struct timeval patience = {.tv_sec = 0, .tv_usec = 100000};
    uint8_t bytes[512], out[COUPLED_LARGEST_bytes];
    coupled_loader loader;
    control column = {0};
    int quiet = 0, wire = socket(AF_INET, SOCK_DGRAM, 0);
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK); /* change it for a host elsewhere */
    here.sin_port = htons((uint16_t)(count > 1 ? atoi(words[1]) : 5760));
    if (wire < 0 || bind(wire, (struct sockaddr *)&here, sizeof here) != 0) {
        perror("loader");
        return 1;
    }
    setsockopt(wire, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    coupled_init(&loader, 1);
    while (quiet < 600) { /* 60 s */
        socklen_t length = sizeof host;
        ssize_t size = recvfrom(wire, bytes, sizeof bytes, 0, (struct sockaddr *)&host, &length);
        quiet = size < 0 ? quiet + 1 : 0;
        if (size < 0 || !coupled_take(&loader, bytes, (size_t)size, now_us())) continue;
        const coupled_order *order = coupled_orders(&loader, now_us());
        if (loader.mode == COUPLED_RUN) advance(&column, order);
        coupled_measured measured = {(float)column.force, (float)column.x,
                                     (float)(column.x + BEND_m_per_N * column.force)};
        size_t made = coupled_state(&loader, &measured, out, now_us());
        sendto(wire, out, made, 0, (struct sockaddr *)&host, length);
    }
    printf("%u packets dropped\n", (unsigned)loader.dropped);
    close(wire);
    return 0;
}
