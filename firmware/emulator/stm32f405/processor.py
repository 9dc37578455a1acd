"""The processor of the STM32F405: a Cortex-M4F in Unicorn, with exceptions, faults and sleep after the ARMv7-M manual
[B1.5, B3.2].

Unicorn runs instructions; entry to and return from exceptions, priorities and fault registers are here.
"""

import struct

from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_HOOK_INTR, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, UcError
from unicorn import arm_const as arm

HARD_FAULT, MEMORY_FAULT, BUS_FAULT, USAGE_FAULT = 3, 4, 5, 6
# Registers of the system control block.
VTOR, AIRCR, CCR, SHCSR, CFSR, HFSR, BFAR, CPACR = (
    0xE000ED08, 0xE000ED0C, 0xE000ED14, 0xE000ED24, 0xE000ED28, 0xE000ED2C, 0xE000ED38, 0xE000ED88,
)
# Causes in CFSR: bus faults, then usage faults.
PRECISE, STACKING, ADDRESS_VALID = 1 << 9, 1 << 12, 1 << 15
UNDEFINED, UNALIGNED, DIVISION = 1 << 16, 1 << 24, 1 << 25
INSTRUCTION_BUS = 1 << 8
DIVISION_TRAP = 1 << 4

SAVED = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR)
# Halfwords of the instructions that sleep or signal.
WFE, WFI, SEV = 0xBF20, 0xBF30, 0xBF40
SELF_BRANCH = b"\xfe\xe7"
# Unicorn's codes for an undefined instruction and a return from an exception.
INTERRUPT_UNDEFINED, INTERRUPT_RETURN = 1, 8


class Processor:
    """Runs instructions until something happens."""

    def __init__(self):
        self.unicorn = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.unicorn.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M4)
        self.unicorn.hook_add(UC_HOOK_INTR, self.on_interrupt)
        self.stop = None
        # Addresses of instructions that fault on this processor but not in Unicorn, with the cause.
        self.traps = {}

    def watch(self, begin, code):
        """Finds instructions that sleep, signal or never end."""
        for offset in range(0, len(code) - 1, 2):
            if code[offset] | code[offset + 1] << 8 in (WFE, WFI, SEV):
                self.trap(begin + offset, None)

    def trap(self, address, cause):
        self.traps[address] = cause
        self.unicorn.hook_add(UC_HOOK_CODE, self.on_trap, begin=address, end=address)

    def restart(self):
        """Sets the state after a reset."""
        self.enabled = [0] * 3
        self.software_pending = set()
        self.priorities = bytearray(96)
        self.active = []
        self.event, self.locked_up, self.asleep = False, False, False
        self.system = {VTOR: 0x0800_0000, CPACR: 0}
        self.faults = []
        write = self.unicorn.reg_write
        for register in range(13):
            write(arm.UC_ARM_REG_R0 + register, 0)
        for register in (arm.UC_ARM_REG_IPSR, arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_CONTROL):
            write(register, 0)
        stack, start = struct.unpack("<II", self.unicorn.mem_read(0x0800_0000, 8))
        write(arm.UC_ARM_REG_SP, stack)
        write(arm.UC_ARM_REG_LR, 0xFFFF_FFFF)
        # The unit enables floating point before using it; in Unicorn it is enabled from the start.
        write(arm.UC_ARM_REG_C1_C0_2, 0xF << 20)
        write(arm.UC_ARM_REG_FPEXC, 0x4000_0000)
        self.pc = start & ~1

    # Interrupts.

    def priority(self, exception):
        """Priority; smaller values take precedence."""
        if exception == HARD_FAULT:
            return -1
        return self.priorities[exception - 16] if exception >= 16 else 0

    def wanted(self, levels):
        """Interrupts that are enabled and pending."""
        waiting = self.software_pending.union(levels)
        return [irq for irq in waiting if self.enabled[irq >> 5] >> (irq & 31) & 1]

    def take(self, levels):
        """Enters the exception of highest priority that may interrupt; returns whether there was one."""
        wanted = self.wanted(levels)
        if not wanted:
            return False
        self.asleep = False
        if self.unicorn.reg_read(arm.UC_ARM_REG_PRIMASK) & 1:
            return False
        current = min((self.priority(exception) for exception in self.active), default=256)
        best = min(wanted, key=lambda irq: (self.priorities[irq], irq))
        if self.priorities[best] >= current:
            return False
        self.software_pending.discard(best)
        self.enter(best + 16)
        return True

    def enter(self, exception):
        """Entry to an exception [B1.5.6]. If the stack cannot hold a frame the handler runs without one."""
        read, write = self.unicorn.reg_read, self.unicorn.reg_write
        control = read(arm.UC_ARM_REG_CONTROL)
        floating = control >> 2 & 1
        words = 26 if floating else 8
        stack = read(arm.UC_ARM_REG_SP)
        padding = 0x200 if stack & 4 else 0
        stack = stack - 4 * words & ~7
        status = read(arm.UC_ARM_REG_XPSR) & ~0x3FF | (self.active[-1] if self.active else 0) | padding | 0x0100_0000
        frame = [read(register) for register in SAVED] + [self.pc, status]
        if floating:
            frame += [read(arm.UC_ARM_REG_S0 + place) for place in range(16)] + [read(arm.UC_ARM_REG_FPSCR), 0]
        try:
            self.unicorn.mem_write(stack, struct.pack("<%dI" % words, *frame))
        except UcError:
            self.system[CFSR] = self.system.get(CFSR, 0) | STACKING
            if exception != HARD_FAULT:
                exception = HARD_FAULT
                self.system[HFSR] = self.system.get(HFSR, 0) | 1 << 30
        write(arm.UC_ARM_REG_SP, stack)
        write(arm.UC_ARM_REG_LR, (0xFFFF_FFF1 if self.active else 0xFFFF_FFF9) & ~(floating << 4))
        write(arm.UC_ARM_REG_CONTROL, control & ~4)
        write(arm.UC_ARM_REG_IPSR, exception)
        self.active.append(exception)
        table = self.system[VTOR]
        self.pc = struct.unpack("<I", self.unicorn.mem_read(table + 4 * exception, 4))[0] & ~1
        self.charge(12)

    def leave(self, value):
        """Return from an exception [B1.5.8]."""
        read, write = self.unicorn.reg_read, self.unicorn.reg_write
        floating = not value >> 4 & 1
        words = 26 if floating else 8
        stack = read(arm.UC_ARM_REG_SP)
        frame = struct.unpack("<%dI" % words, self.unicorn.mem_read(stack, 4 * words))
        for register, word in zip(SAVED, frame):
            write(register, word)
        if floating:
            for place in range(16):
                write(arm.UC_ARM_REG_S0 + place, frame[8 + place])
            write(arm.UC_ARM_REG_FPSCR, frame[24])
        self.pc, status = frame[6] & ~1, frame[7]
        self.active.pop()
        below = self.active[-1] if self.active else 0
        write(arm.UC_ARM_REG_XPSR, status & ~0x3FF | below)
        write(arm.UC_ARM_REG_IPSR, below)
        write(arm.UC_ARM_REG_SP, stack + 4 * words + (4 if status & 0x200 else 0))
        control = read(arm.UC_ARM_REG_CONTROL)
        write(arm.UC_ARM_REG_CONTROL, control & ~4 | floating << 2)
        self.event = True
        self.charge(12)

    # Faults.

    def fault(self, cause, address=None):
        """Records the cause and enters the handler, or locks up if that is itself a fault handler [B1.5.15]."""
        self.faults.append((self.pc, cause))
        self.system[CFSR] = self.system.get(CFSR, 0) | cause
        if address is not None:
            self.system[CFSR] |= ADDRESS_VALID
            self.system[BFAR] = address
        if HARD_FAULT in self.active:
            self.locked_up = True
            return
        exception, bit = (BUS_FAULT, 17) if cause < UNDEFINED else (USAGE_FAULT, 18)
        enabled = self.system.get(SHCSR, 0) >> bit & 1
        if not enabled or self.active or self.unicorn.reg_read(arm.UC_ARM_REG_PRIMASK) & 1:
            self.system[HFSR] = self.system.get(HFSR, 0) | 1 << 30
            exception = HARD_FAULT
        self.enter(exception)

    # Running.

    def on_interrupt(self, _, number, __):
        self.stop = ("interrupt", number)
        self.unicorn.emu_stop()

    def on_trap(self, _, address, __, ___):
        self.stop = ("trap", address)
        self.unicorn.emu_stop()

    def run(self, count):
        """Runs at most this many instructions; returns how many ran, estimated after an error."""
        self.stop = None
        before = self.pc
        try:
            self.unicorn.emu_start(self.pc | 1, 0xFFFF_FFFE, count=count)
        except UcError as error:
            if self.stop is None:
                self.pc = self.unicorn.reg_read(arm.UC_ARM_REG_PC) & ~1
                self.broken(error)
                return max(1, count // 2)
        pc = self.unicorn.reg_read(arm.UC_ARM_REG_PC)
        self.pc = pc & ~1
        if self.stop is None:
            # A branch to itself only waits for an interrupt.
            if self.pc == before and self.unicorn.mem_read(before, 2) == SELF_BRANCH:
                self.asleep = True
            return count
        self.handle(pc)
        return max(1, count // 2)

    def broken(self, error):
        """Handles an error of Unicorn."""
        address = self.unicorn.reg_read(arm.UC_ARM_REG_PC)
        if "fetch" in str(error).lower():
            self.pc = address & ~1
            self.fault(INSTRUCTION_BUS)
        elif "instruction" in str(error).lower():
            self.fault(UNDEFINED)
        else:
            self.fault(PRECISE, self.bad_address)

    def handle(self, pc):
        kind, detail = self.stop
        if kind == "reset":
            return
        if kind == "interrupt":
            if detail == INTERRUPT_RETURN:
                self.leave(pc | 1 if pc > 0xFFFF_FF00 else self.unicorn.reg_read(arm.UC_ARM_REG_LR))
            else:
                self.fault(UNDEFINED if detail == INTERRUPT_UNDEFINED else PRECISE)
            return
        self.pc = detail
        cause = self.traps[detail]
        if cause is not None:
            self.trapped(cause)
            return
        instruction = struct.unpack("<H", self.unicorn.mem_read(detail, 2))[0]
        self.pc += 2
        if instruction == SEV:
            self.event = True
        elif instruction == WFE and self.event:
            self.event = False
        else:
            self.asleep = True

    def trapped(self, cause):
        """Handles an instruction that faults on this processor but not in Unicorn."""
        if cause == DIVISION and not self.system.get(CCR, 0) & DIVISION_TRAP:
            self.pc += 4
        else:
            self.fault(cause)
