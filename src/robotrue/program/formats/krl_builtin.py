"""Routines and functions of the KUKA controller itself: what they leave alone."""

from __future__ import annotations

from typing import Final

# Calls that leave frames alone: operators, statements and functions of the controller itself.
HARMLESS: Final = frozenset(
    """and or not exor b_and b_or b_exor b_not if while until for switch case wait sec halt return
    repeat to step then do sin cos tan acos atan2 sqrt abs round trunc inv_pos forward inverse
    toframe invop pulse bas cr_process_file signal cast_from cast_to copen cclose cread cwrite
    sread swrite strlen strcomp strcopy stradd strfind strclear strdeclen strtoint strtoreal
    strtobool b_not varstate get_sig_inf set_sys_data wait_for on_error_proceed err_raise msg
    msgnotify msgquit msgdialog msgstate set_kdo_values timer_limit spline spl lin ptp circ slin
    sptp scirc lin_rel ptp_rel circ_rel trigger interrupt when delay distance path prio onstart
    anin anout pto ezero delete_backward_buffer svel_cp svel_joint stool stool2 sbase sipo_mode
    sload
    ir_stopm rob_stop rob_stop_release is_key_pressed set_krl_msg set_krl_dlg exists_krl_msg
    exists_krl_dlg clear_krl_msg krl_fopen krl_fclose krl_fread krl_fwrite krl_fputs cioctl lk
    strtoframe strtopos strtoe6pos mbx_rec wsostatus
    sacc_cp sacc_joint sapo sapo_ptp sori_typ sjerk sgear_jerk use_cm_pro_values ek k_root k_type
    k_offs time_block""".split()
)

PURE: Final = frozenset(
    """and or not exor b_and b_or b_exor b_not if while until for switch case wait sec return repeat
    do sin cos tan acos atan2 sqrt abs round trunc inv_pos forward inverse toframe pulse bas
    varstate when stool stool2 sbase sipo_mode sload sacc_cp sacc_joint sapo sapo_ptp sori_typ
    sjerk svel_cp svel_joint sgear_jerk use_cm_pro_values ek k_root k_type k_offs time_block
    cr_process_file strlen strcomp is_key_pressed msgnotify msgquit cwrite swrite krl_fwrite
    krl_fputs wait_for set_kdo_values delay distance path prio onstart trigger interrupt
    spline halt""".split()
)
"""Those of them that change no variable handed over."""
