//! The same code for the machine's wider vectors.

/// Defines a function that runs compiled for AVX-512 or AVX2 where the machine has it, and as it stands elsewhere.
///
/// Only the width of vectors differs, never the arithmetic (no fused multiply-add), so all machines give the same bits.
/// What the function calls must be `#[inline(always)]` to be compiled with it.
macro_rules! wide {
    (
        $(#[$about:meta])*
        fn $name:ident $(<$rule:ident: $bound:ident>)? ($($argument:ident: $kind:ty),* $(,)?) $(-> $out:ty)? $body:block
    ) => {
        $(#[$about])*
        fn $name $(<$rule: $bound>)? ($($argument: $kind),*) $(-> $out)? {
            #[inline(always)]
            fn plain $(<$rule: $bound>)? ($($argument: $kind),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2 $(<$rule: $bound>)? ($($argument: $kind),*) $(-> $out)? {
                    plain($($argument),*)
                }
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                fn avx512 $(<$rule: $bound>)? ($($argument: $kind),*) $(-> $out)? {
                    plain($($argument),*)
                }
                if std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512bw")
                    && std::arch::is_x86_feature_detected!("avx512dq")
                    && std::arch::is_x86_feature_detected!("avx512vl")
                {
                    // SAFETY: the machine was just asked and has these.
                    return unsafe { avx512($($argument),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the machine was just asked and has AVX2.
                    return unsafe { avx2($($argument),*) };
                }
            }
            plain($($argument),*)
        }
    };
}

pub(crate) use wide;
