//! Presets, rules and the order of writes.

use super::*;

#[test]
fn any_sensor_has_registers_that_keep_the_rules_and_its_rate() {
    for (rows, columns, rate, bits) in [(16, 8, 50.0, 12), (4, 5, 1000.0, 16), (128, 128, 400.0, 8), (1, 1, 0.1, 1)] {
        let array = Array::new(rows, columns, 1.0, "other").unwrap();
        let (registers, shift) = Registers::of_source(&array, rate, bits).unwrap();
        assert_eq!(u32::from(registers.ramp), ((1 << bits) - 1) >> shift);
        assert!((1e6 / registers.frame_us() / rate - 1.0).abs() < 1e-3, "{registers:?}");
        assert!(shift == 0 || bits == 16, "{shift} of {bits}");
    }
    let array = Array::new(64, 64, 1.0, "other").unwrap();
    for (rate, bits) in [(1e6, 8), (0.0, 8), (f64::NAN, 8), (-1.0, 8), (100.0, 0), (100.0, 17)] {
        assert!(Registers::of_source(&array, rate, bits).is_err());
    }
}

fn thesis() -> Array {
    Array::thesis()
}

#[test]
fn a_preset_leaves_what_it_does_not_say() {
    let array = Array::new(16, 8, 1.0, "small").unwrap();
    for (wire_version, record, channels) in [(1, false, 16), (2, true, 64)] {
        let held = Registers { wire_version, record, channels, ..Registers::at_reset(&array, channels) };
        for preset in PRESETS {
            let then = held.with_preset(&preset.registers, &array);
            assert_eq!(
                (then.wire_version, then.record, then.channels, then.lines),
                (wire_version, record, channels, 8)
            );
            let chosen = Registers { wire_version, record, channels, lines: 8, ..preset.registers };
            assert_eq!(then, chosen, "{}", preset.name);
        }
    }
    let names_for = |lines, channels| {
        let array = Array::new(lines, lines, 1.0, "any").unwrap();
        Registers::presets(&array, channels).map(|preset| preset.name).collect::<Vec<_>>()
    };
    assert_eq!(names_for(8, 16), ["5.2 kHz", "2 kHz", "5.2 kHz, FA-1"]);
    assert_eq!(names_for(64, 64), ["20.8 kHz", "5.2 kHz, 64 channels"]);
    assert_eq!(names_for(128, 16), ["128 x 128, 1.3 kHz"]);
}

#[test]
fn presets_keep_the_rules_and_their_rates() {
    let rates = [5208.33, 2000.64, 20_833.3, 5208.33, 5208.33, 1000.32, 2003.21, 5208.33, 1302.08];
    for (Preset { name, sense_lines, registers }, rate) in PRESETS.iter().zip(rates) {
        let array = Array::new(*sense_lines, *sense_lines, 1.0, "of the preset's size").unwrap();
        assert_eq!(registers.check(&array), Ok(()), "{name}");
        assert!(registers.warnings().is_empty(), "{name}");
        assert!((1e6 / registers.frame_us() / rate - 1.0).abs() < 1e-5, "{name}");
    }
    assert_eq!(Registers::default().frame_us(), 192.0);
}

#[test]
fn a_set_comes_back_from_its_eight_words() {
    for &Preset { sense_lines, registers: preset, .. } in PRESETS {
        let array = Array::new(sense_lines, sense_lines, 1.0, "of the preset's size").unwrap();
        let mut board = Registers::at_reset(&array, preset.channels);
        for command in board.commands_to(&preset, &array).unwrap() {
            board.write(command, &array).unwrap();
        }
        assert_eq!(board, preset);
        let words = std::array::from_fn(|n| board.word(n as u8));
        assert_eq!(Registers::of_words(&words, preset.channels), preset);
    }
}

#[test]
fn every_rule_refuses_with_its_numbers_and_keeps_the_old_value() {
    let cases = [
        (1, 299, 1),
        (2, 320, 1),
        (2, 299, 2),
        (3, 76 << 16 | 75, 1),
        (4, 161, 3),
        (3, 55 << 16 | 51, 1),
        (4, 0, 4),
        (0, 1, 5),
        (7, 1, 4),
        (6, 9, 4),
    ];
    for (register, value, rule) in cases {
        let mut registers = Registers::default();
        let refusal = registers.write(Command { register, value }, &thesis()).unwrap_err();
        assert_eq!((refusal.register, refusal.rule), (register, rule));
        assert_eq!(registers, Registers::default());
    }
    let small = Array::new(8, 8, 1.0, "small").unwrap();
    let refusal = Registers::default().write(Command { register: 5, value: 8 << 16 }, &small).unwrap_err();
    assert_eq!(refusal.rule, 4);
}

#[test]
fn a_board_of_any_size_resets_to_registers_that_keep_the_rules() {
    for (rows, columns) in [(1, 1), (8, 8), (64, 64), (65, 3), (3, 65), (100, 100), (128, 128), (256, 256), (512, 128)]
    {
        let array = Array::new(rows, columns, 1.0, "any").unwrap();
        for channels in [16, 64] {
            let registers = Registers::at_reset(&array, channels);
            assert_eq!(registers.check(&array), Ok(()), "{rows} x {columns}, {channels} channels");
            assert!(registers.warnings().is_empty());
            assert_eq!(registers.lines, columns);
            assert_eq!(registers.wire_version, if rows > 64 || columns > 64 { 2 } else { 1 });
        }
    }
    let large = Array::new(128, 128, 1.0, "large").unwrap();
    assert_eq!(Registers::at_reset(&large, 64), Registers::preset("128 x 128, 1 kHz").unwrap());
    assert_eq!(Registers::at_reset(&large, 16), Registers::preset("128 x 128, 1.3 kHz").unwrap());
    let version_1 = Registers { wire_version: 1, ..Registers::at_reset(&large, 64) };
    assert!(matches!(version_1.check(&large), Err(Error::Device(_))));
    let hasty = Registers { step_period: 73, step_read: 53, ..Registers::preset("20.8 kHz").unwrap() };
    assert!(matches!(hasty.check(&thesis()), Err(Error::Device(_))));
}

#[test]
fn the_manuals_names_are_aliases() {
    let (mut a, mut b) = (Registers::default(), Registers::default());
    a.set("line_period", 400, &thesis()).unwrap();
    b.set("row_change_period", 400, &thesis()).unwrap();
    a.set("lines", 32, &thesis()).unwrap();
    b.set("nrows", 31, &thesis()).unwrap();
    assert_eq!(a, b);
    assert!(a.set("lines", 0, &thesis()).is_err());
    assert!(a.set("lines", 65, &thesis()).is_err());
    assert!(a.set("nrows", 256, &thesis()).is_err());
    assert!(a.set("speed", 1, &thesis()).is_err());
}

#[test]
fn any_set_leads_to_any_other_without_a_refusal() {
    use rand::{Rng, SeedableRng, rngs::StdRng};
    let mut random = StdRng::seed_from_u64(5);
    let mut draw = || loop {
        let top = 1 << random.random_range(4..20);
        let mut registers = Registers {
            line_period: random.random_range(1..top),
            line_read: random.random_range(1..top),
            step_period: random.random_range(1..top.min(65_536)) as u16,
            step_read: random.random_range(1..top.min(65_536)) as u16,
            ramp: random.random_range(1..top.min(65_536)) as u16,
            noise_floor: random.random(),
            lines: random.random_range(1..=64),
            random_lines: random.random(),
            ..Registers::default()
        };
        registers.line_read = registers.line_read.min(registers.line_period);
        registers.step_period = registers.step_period.min((registers.line_read / 4) as u16);
        registers.step_read = registers.step_read.min(registers.step_period);
        if registers.check(&thesis()).is_ok() {
            return registers;
        }
    };
    for _ in 0..2000 {
        let (mut board, target) = (draw(), draw());
        for command in board.commands_to(&target, &thesis()).unwrap() {
            board.write(command, &thesis()).unwrap();
        }
        assert_eq!(board, target);
    }
}

#[test]
fn the_power_law_is_rounded_to_the_nearest() {
    let scale = f64::from(1 << POWER_LAW_FRACTION);
    for (tick, &entry) in POWER_LAW.iter().enumerate() {
        assert!((f64::from(entry) - (tick as f64).powf(0.7) * scale).abs() <= 0.5, "{tick}");
    }
    assert_eq!((POWER_LAW[3], POWER_LAW[2047]), (141_405, 13_622_676), "as the logic has them");
}
