/* Reads a log as CSV: "time" and the signals of fw_names in columns.

   The first line names the columns, in any order. A unit in brackets must be the one of fw_units; without it the numbers
   count as SI. Other columns are ignored. Without a line of names the columns are those of fw_names, in this order.
   "nan" or nothing: missing. */

#ifndef FW_REPLAY_LOG_H
#define FW_REPLAY_LOG_H

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

/* A log from standard input. */
typedef struct {
    char line[65536];
    int places[MOST_COLUMNS];
    int columns;
    long row;
} replay_log;

static void open_log(replay_log *log)
{
    log->columns = COUNT;
    log->row = 0;
    for (int i = 0; i < COUNT; i++) {
        log->places[i] = i;
    }
}

/* Prints which columns a log must have. */
static void print_expected(void)
{
    (void)fprintf(stderr, "line 1: a signal is missing; expected");
    for (int i = 0; i < COUNT; i++) {
        (void)fprintf(stderr, " %s [%s]", fw_names[i], fw_units[i]);
    }
    (void)fprintf(stderr, "\n");
}

/* Reads the next sample: 1, 0 at the end of the log, -1 after an error, which is printed. */
static int read_sample(replay_log *log, fw_sample *sample)
{
    double numbers[COUNT];
    if (fgets(log->line, (int)sizeof log->line, stdin) == NULL) {
        return 0;
    }
    log->row++;
    if (log->row == 1 && strstr(log->line, "time") != NULL) {
        log->columns = read_names(log->line, log->places);
        if (log->columns < 0) {
            print_expected();
            return -1;
        }
        if (fgets(log->line, (int)sizeof log->line, stdin) == NULL) {
            return 0;
        }
        log->row++;
    }
    if (read_numbers(log->line, log->places, log->columns, numbers) != log->columns) {
        (void)fprintf(stderr, "line %ld: expected %d columns; name them in the first line\n", log->row, log->columns);
        return -1;
    }
    sample->time = numbers[0];
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        sample->input[i] = (fw_real)numbers[1 + i];
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        sample->measured[i] = (fw_real)numbers[1 + FW_INPUT_COUNT + i];
    }
    return 1;
}

#endif
