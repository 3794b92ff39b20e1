"""Emulated electronics: what the drivers of ``robot`` talk to when there is no robot.

=============================  ================================  ==================================
emulator                       behaves as                        does not model
=============================  ================================  ==================================
``sv203.SV203Emulator``        servo board behind a real pty     baud rate, the delay of ``D``,
                                                                 EEPROM programs, infra-red
``dmm32.DMM32Emulator``        register file on I/O ports        DACs, digital I/O, counters,
                                                                 interrupts, differential inputs
``vl6180x.VL6180XEmulator``    registers on an I²C bus           light sensor, history buffer,
                                                                 interrupt pin, ambient light
``pca9685.PCA9685Emulator``    registers on an I²C bus           open-drain outputs, test mode
``mpu6050.MPU6050Emulator``    registers on an I²C bus           gyroscope, FIFO, filters
``ads1115.ADS1115Emulator``    registers on an I²C bus           comparator
``i2c_bus.I2CBus``             the bus that they are on, and     clock stretching, several masters,
                               its adapter                       transfers cut off half-way
=============================  ================================  ==================================

They are told what there is to feel by plain callables, know nothing of bodies, and charge the
``clock`` for each access as the real electronics would take: 1 µs a port, 100 µs an I²C transfer.
An idle emulator costs nothing. Each has faults that can be switched on, see ``fault_switch``; those
of the ``servos`` themselves lie behind the board, whose processor is ``sv203_board``.
"""
