/* The longest step of the model. Included after the numbers of the vehicle. */

#ifndef FW_STEP_LENGTH_H
#define FW_STEP_LENGTH_H

/* The longest step of the model at a speed, s. */
static fw_real fw_longest_step(fw_real speed)
{
    fw_real longest = fw_step_limit[FW_SPEED_COUNT - 1];
    if (speed <= fw_step_speed[0]) {
        longest = fw_step_limit[0] * (speed / fw_step_speed[0]);
    } else if (speed >= fw_step_speed[FW_SPEED_COUNT - 1]) {
        longest *= fw_step_speed[FW_SPEED_COUNT - 1] / speed;
    } else {
        int i = 0;
        fw_real slope;
        while (speed > fw_step_speed[i + 1]) {
            i++;
        }
        slope = (fw_step_limit[i + 1] - fw_step_limit[i]) / (fw_step_speed[i + 1] - fw_step_speed[i]);
        longest = fw_step_limit[i] + (slope * (speed - fw_step_speed[i]));
    }
    return longest;
}

#endif
