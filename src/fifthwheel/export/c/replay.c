/* Replays a log through the observer: lines of numbers from standard input, states to standard output.

   The first line names the columns: "time" and the signals, in any order. A unit in brackets must be the one of fw_units;
   without it the numbers count as SI. Other columns are ignored. Without a line of names the columns are those of fw_names, in this order. "nan" or
   nothing: missing. An answer is time, status, nis, then values and sigmas. */

#include "fw_observer.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COUNT (1 + FW_INPUT_COUNT + FW_MEASURED_COUNT)
#define MOST_COLUMNS 1000

/* Whether a column has this name, and this unit if it has one in brackets. */
static int is_named(const char *column, size_t length, const char *name, const char *unit)
{
    const size_t own = strlen(name);
    const char *bracket = memchr(column, '[', length);
    if (length < own || strncmp(column, name, own) != 0 || (length > own && strchr(" [\r", column[own]) == NULL)) {
        return 0;
    }
    return bracket == NULL || (strncmp(bracket + 1, unit, strlen(unit)) == 0 && bracket[1 + strlen(unit)] == ']');
}

/* The place of a column in fw_names, -1 if it is none of them. */
static int place_of(const char *column, size_t length)
{
    for (int i = 0; i < COUNT; i++) {
        if (is_named(column, length, fw_names[i], fw_units[i]) != 0) {
            return i;
        }
    }
    return -1;
}

/* Gives the columns of a line of names their places, and their number; -1 if a signal is missing. */
static int read_names(const char *line, int *places)
{
    int columns = 0;
    int found = 0;
    for (const char *at = line; columns < MOST_COLUMNS; at++) {
        const size_t length = strcspn(at, ",\n");
        places[columns] = place_of(at, length);
        found += (places[columns] >= 0) ? 1 : 0;
        columns++;
        at += length;
        if (*at != ',') {
            break;
        }
    }
    return (found == COUNT) ? columns : -1;
}

/* Reads a line into numbers by place; returns the number of its columns. */
static int read_numbers(const char *line, const int *places, int columns, double *numbers)
{
    int column = 0;
    for (const char *at = line;; at++) {
        const size_t length = strcspn(at, ",\n");
        char *end = NULL;
        const double value = strtod(at, &end);
        if (column < columns && places[column] >= 0) {
            numbers[places[column]] = (end == at || end > at + length) ? NAN : value;
        }
        column++;
        at += length;
        if (*at != ',') {
            return column;
        }
    }
}

int main(void)
{
    static fw_observer observer;
    static char line[65536];
    static int places[MOST_COLUMNS];
    int columns = COUNT;
    long row = 0;
    for (int i = 0; i < COUNT; i++) {
        places[i] = i;
    }
    fw_observer_init(&observer);
    while (fgets(line, (int)sizeof line, stdin) != NULL) {
        double numbers[COUNT];
        fw_sample sample;
        fw_states states;
        row++;
        if (row == 1 && strstr(line, "time") != NULL) {
            columns = read_names(line, places);
            if (columns < 0) {
                (void)fprintf(stderr, "line 1: a signal is missing; expected");
                for (int i = 0; i < COUNT; i++) {
                    (void)fprintf(stderr, " %s [%s]", fw_names[i], fw_units[i]);
                }
                (void)fprintf(stderr, "\n");
                return 2;
            }
            continue;
        }
        if (read_numbers(line, places, columns, numbers) != columns) {
            (void)fprintf(stderr, "line %ld: expected %d columns; name them in the first line\n", row, columns);
            return 2;
        }
        sample.time = numbers[0];
        for (int i = 0; i < FW_INPUT_COUNT; i++) {
            sample.input[i] = (fw_real)numbers[1 + i];
        }
        for (int i = 0; i < FW_MEASURED_COUNT; i++) {
            sample.measured[i] = (fw_real)numbers[1 + FW_INPUT_COUNT + i];
        }
        if (fw_observer_push(&observer, &sample, &states) != FW_SUCCESS) {
            (void)fprintf(stderr, "line %ld: time is not after the last one, or the gap is too long\n", row);
            continue;
        }
        (void)printf("%.17g,%d,%.17g", states.time, (int)states.status, (double)states.nis);
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            (void)printf(",%.17g", (double)states.value[i]);
        }
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            (void)printf(",%.17g", (double)states.sigma[i]);
        }
        (void)printf("\n");
    }
    return 0;
}
