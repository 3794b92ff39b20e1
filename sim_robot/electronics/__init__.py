"""Emulated electronics: what the drivers of ``robot`` talk to when there is no robot.

=============================  ================================  ==================================
emulator                       behaves as                        does not model
=============================  ================================  ==================================
``sv203.SV203Emulator``        servo board behind a real pty     baud rate, the delay of ``D``,
                                                                 EEPROM programs, infra-red
``dmm32.DMM32Emulator``        register file on I/O ports        DACs, digital I/O, counters,
                                                                 interrupts, differential inputs
``vl6180x.VL6180XEmulator``    registers on an I²C bus           light sensor, continuous ranging,
                                                                 history buffer, interrupt pin
=============================  ================================  ==================================

They are told what there is to feel by plain callables, know nothing of bodies, and charge the
clock for each access as the real electronics would take: 1 µs a port, 100 µs an I²C transfer. An
idle emulator costs nothing. Each has switchable faults, see ``faults.FaultSwitch``.
"""
