//! The type of a register's field, and the numbers of the array that the rules need.

/// Position of a field in its register, and the values that it can have (Table 5.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Field {
    /// Name in taxel.
    pub name: &'static str,
    /// Name in the manual.
    pub manual: &'static str,
    /// Unit; "flag" for a field that is on or off.
    pub unit: &'static str,
    /// Description.
    pub text: &'static str,
    /// Number of the register, 0 to 7.
    pub register: u8,
    /// Lowest bit.
    pub shift: u32,
    /// Mask of its bits, after shifting down.
    pub mask: u32,
    /// Added to the bits.
    pub offset: u32,
    /// Smallest valid value.
    pub least: u32,
    /// Largest valid value.
    pub greatest: u32,
}

/// A value as the bits of a field.
pub(super) trait Bits {
    fn bits(self) -> u32;
    fn of_bits(bits: u32) -> Self;
}

impl Bits for bool {
    fn bits(self) -> u32 {
        u32::from(self)
    }

    fn of_bits(bits: u32) -> Self {
        bits == 1
    }
}

macro_rules! bits_of_numbers {
    ($($number:ident)*) => {
        $(impl Bits for $number {
            fn bits(self) -> u32 {
                self as u32
            }

            fn of_bits(bits: u32) -> Self {
                bits as Self
            }
        })*
    };
}
bits_of_numbers! { u8 u16 u32 }

/// Makes the struct that holds the registers, its words and the list of its fields, of one line a field.
macro_rules! registers {
    (
        $(
            #[doc = $text:literal]
            $(#[serde($($serde:tt)*)])? $name:ident: $type:ident, $manual:literal, $unit:literal,
            $register:literal, $shift:literal, $mask:literal, $offset:literal, $least:literal, $greatest:literal, $reset:literal;
        )*
        ;
        $(#[doc = $about:literal] $other:ident: $kind:ident, $other_reset:literal;)*
    ) => {
        /// The values of the registers, in the registers' own units (Table 5.5).
        #[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Registers {
            $(#[doc = $text] #[doc = concat!(" Unit: ", $unit, ".")] $(#[serde($($serde)*)])? pub $name: $type,)*
            $(#[doc = $about] pub $other: $kind,)*
        }

        /// The values at reset.
        pub(super) const AT_RESET: Registers = Registers { $($name: $reset,)* $($other: $other_reset,)* };

        /// All fields, in the order of the registers.
        pub(super) const FIELDS: &[$crate::wire::registers::Field] = &[
            $($crate::wire::registers::Field {
                name: stringify!($name),
                manual: $manual,
                unit: $unit,
                text: $text.trim_ascii_start(),
                register: $register,
                shift: $shift,
                mask: $mask,
                offset: $offset,
                least: $least,
                greatest: $greatest,
            },)*
        ];

        impl Registers {
            /// The word of register `n`; 0 if there is no such register.
            #[must_use]
            pub fn word(&self, n: u8) -> u32 {
                let mut word = 0;
                $(if n == $register {
                    word |= ($crate::wire::registers::field::Bits::bits(self.$name).wrapping_sub($offset) & $mask) << $shift;
                })*
                word
            }

            /// Mask of the bits of register `n`; the others are reserved and must be 0.
            #[must_use]
            pub fn mask(n: u8) -> u32 {
                FIELDS.iter().filter(|field| field.register == n).fold(0, |mask, field| mask | field.mask << field.shift)
            }

            /// Sets a register's fields without checking the rules.
            pub(super) fn store(&mut self, register: u8, value: u32) {
                $(if register == $register {
                    self.$name = $crate::wire::registers::field::Bits::of_bits((value >> $shift & $mask) + $offset);
                })*
            }
        }
    };
}

/// Makes the list of presets, of one line a preset.
macro_rules! presets {
    ($($name:literal, $sense_lines:literal: $($field:ident $value:literal),*;)*) => {
        /// A named set of register values.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub struct Preset {
            /// Name of the preset.
            pub name: &'static str,
            /// Number of sense lines of the boards for which it is made.
            pub sense_lines: u16,
            /// The values of the registers.
            pub registers: Registers,
        }

        /// The presets, in the order of the reference; a board's registers at reset are the first preset for its array's size.
        pub const PRESETS: &[Preset] = &[
            $(Preset {
                name: $name,
                sense_lines: $sense_lines,
                registers: Registers { $($field: $value,)* ..AT_RESET },
            },)*
        ];
    };
}

/// Makes a function that returns the rules that values break, each with its number and text, of two lines a rule.
macro_rules! rules {
    (
        #[doc = $about:literal]
        fn $name:ident($($of:ident: $kind:ident [$($value:ident)*]),*);
        $($rule:literal, $broken:expr => $text:literal $(, $shown:expr)*;)*
    ) => {
        #[doc = $about]
        pub(super) fn $name($($of: &$kind),*) -> Vec<(u8, String)> {
            $($(let $value = i64::from($of.$value);)*)*
            let mut broken = vec![];
            $(if $broken {
                broken.push(($rule, format!($text $(, $shown)*)));
            })*
            broken
        }
    };
}

pub(super) use {presets, registers, rules};

/// The numbers of an array on a board that the rules need.
pub(super) struct Scanned {
    pub(super) steps: u32,
    pub(super) driven_lines: u16,
    pub(super) sense_lines: u16,
}

/// Formats a time in units of 10 ns as us, with two decimals.
pub(super) fn us(units: i64) -> String {
    let sign = if units < 0 { "-" } else { "" };
    format!("{sign}{}.{:02}", units.abs() / 100, units.abs() % 100)
}
