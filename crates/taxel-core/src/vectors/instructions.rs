//! Which vector instructions the machine has, and functions compiled for each of them.

use std::sync::OnceLock;

use crate::{Result, problem};

/// The widest set that may be used, once it has been determined.
static BEST: OnceLock<Instructions> = OnceLock::new();

/// A set of vector instructions for which code is written or compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Instructions {
    /// No vector instructions: runs on every machine.
    Plain,
    /// AVX2 with fused multiply-add (and BMI1, POPCNT).
    Avx2,
    /// AVX-512 F, BW, DQ and VL.
    Avx512,
}

impl Instructions {
    /// All sets, from the narrowest; a machine that has one also has those before it.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Avx2, Self::Avx512];

    /// The widest set that may be used: that of this machine, or a narrower one after [`cap`](Self::cap).
    #[must_use]
    #[inline]
    pub fn best() -> Self {
        *BEST.get_or_init(Self::widest)
    }

    /// The widest set that this machine has.
    fn widest() -> Self {
        Self::ALL.into_iter().take_while(|set| set.detected()).last().unwrap_or(Self::Plain)
    }

    /// Allows no set wider than the named one in this process; must be called before anything is computed.
    ///
    /// # Errors
    ///
    /// `Problem` if no set has this name, if this machine lacks it, or if another set is already in use.
    pub fn cap(name: &str) -> Result<()> {
        let set = Self::named(name).ok_or_else(|| {
            problem!("TAXEL_INSTRUCTIONS is {name:?}: must be {}", Self::ALL.map(Self::name).join(", "))
        })?;
        let widest = Self::widest();
        if set > widest {
            return Err(problem!("TAXEL_INSTRUCTIONS is {name:?}: this machine has at most {}", widest.name()));
        }
        if *BEST.get_or_init(|| set) != set {
            return Err(problem!("TAXEL_INSTRUCTIONS is {name:?}: {} is in use already", Self::best().name()));
        }
        Ok(())
    }

    /// The set with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|set| set.name() == name)
    }

    /// The name of the set in TAXEL_INSTRUCTIONS.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Whether this set may be used.
    #[must_use]
    #[inline]
    pub fn present(self) -> bool {
        self <= Self::best()
    }

    /// Returns the set if this machine has it.
    ///
    /// # Errors
    ///
    /// `Problem` if the machine lacks the set.
    pub fn checked(self) -> Result<Self> {
        if self.present() { Ok(self) } else { Err(problem!("instructions {self:?}: this machine does not have them")) }
    }

    /// Whether the machine has the instructions that this set adds to the one before.
    fn detected(self) -> bool {
        match self {
            Self::Plain => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                is_x86_feature_detected!("avx2")
                    && is_x86_feature_detected!("fma")
                    && is_x86_feature_detected!("bmi1")
                    && is_x86_feature_detected!("popcnt")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }
}

/// Dispatches on a set of [`Instructions`] to a variant compiled for AVX-512, for AVX2 or without vector instructions.
macro_rules! by_width {
    ($set:expr, ($($argument:ident: $kind:ty),*) $(-> $out:ty)?, [$($generic:tt)*], $avx512:expr, $avx2:expr, $plain:expr) => {{
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,popcnt")]
            fn avx512 $($generic)* ($($argument: $kind),*) $(-> $out)? {
                $avx512($($argument),*)
            }
            #[target_feature(enable = "avx2,fma,bmi1,popcnt")]
            fn avx2 $($generic)* ($($argument: $kind),*) $(-> $out)? {
                $avx2($($argument),*)
            }
            let set: $crate::vectors::Instructions = $set;
            if set >= $crate::vectors::Instructions::Avx512 {
                // SAFETY: the machine has these instructions: the set is its widest, or was just asserted to be
                // present.
                return unsafe { avx512($($argument),*) };
            }
            if set == $crate::vectors::Instructions::Avx2 {
                // SAFETY: as above.
                return unsafe { avx2($($argument),*) };
            }
        }
        // Other architectures have one variant only.
        #[cfg(not(target_arch = "x86_64"))]
        let _: $crate::vectors::Instructions = $set;
        $plain($($argument),*)
    }};
}

/// Defines a function that is compiled for AVX-512, for AVX2 and without either, and dispatches to the machine's
/// variant.
///
/// Only the width of the vectors differs, not the arithmetic (the compiler fuses no operations by itself), so every
/// machine computes the same bits. Functions called inside must be `#[inline(always)]` to be compiled for the same set.
macro_rules! wide {
    (
        $(#[$about:meta])*
        $visible:vis fn $name:ident $(<$rule:ident: $bound:ident>)? ($($argument:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block
    ) => {
        $(#[$about])*
        $visible fn $name $(<$rule: $bound>)? ($($argument: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn plain $(<$rule: $bound>)? ($($argument: $kind),*) $(-> $out)? $body
            $crate::vectors::by_width!(
                $crate::vectors::Instructions::best(),
                ($($argument: $kind),*) $(-> $out)?, [$(<$rule: $bound>)?], plain, plain, plain
            )
        }
    };
}

/// Defines a function over [`Vector`](super::Vector)s `V`, compiled for AVX-512, for AVX2 and without either.
macro_rules! kernel {
    (
        $(#[$about:meta])*
        $visible:vis fn $name:ident<$vector:ident>($($argument:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block
    ) => {
        $(#[$about])*
        $visible fn $name($($argument: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn plain<$vector: $crate::vectors::Vector>($($argument: $kind),*) $(-> $out)? $body
            $crate::vectors::by_width!(
                $crate::vectors::Instructions::best(), ($($argument: $kind),*) $(-> $out)?, [],
                plain::<$crate::vectors::Zmm>, plain::<$crate::vectors::Ymm>, plain::<[f64; $crate::vectors::LANES]>
            )
        }
    };
}

pub(crate) use {by_width, kernel, wide};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_sets_are_refused_and_a_set_in_use_stays() {
        assert!(Instructions::cap("avx3").is_err());
        let used = Instructions::best();
        assert!(Instructions::cap(used.name()).is_ok());
        for other in Instructions::ALL.into_iter().filter(|&set| set != used) {
            assert!(Instructions::cap(other.name()).is_err());
        }
        assert_eq!(Instructions::best(), used);
    }
}
