//! Values as bytes and back with the same bits: numbers in little-endian order, lists behind their length.

use nalgebra::DMatrix;

/// A value that can be kept.
pub trait Stored: Sized {
    /// Appends it.
    fn put(&self, out: &mut Vec<u8>);

    /// Takes it from the front; `None` where the bytes are not those of such a value.
    fn take(from: &mut Bytes<'_>) -> Option<Self>;
}

/// Bytes that are read from the front.
pub struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    fn next<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }
}

macro_rules! number {
    ($($kind:ty),*) => { $(
        impl Stored for $kind {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend(self.to_le_bytes());
            }

            fn take(from: &mut Bytes<'_>) -> Option<$kind> {
                from.next().map(<$kind>::from_le_bytes)
            }
        }
    )* };
}

number!(f64, u64, u8);

impl Stored for usize {
    fn put(&self, out: &mut Vec<u8>) {
        (*self as u64).put(out);
    }

    fn take(from: &mut Bytes<'_>) -> Option<usize> {
        u64::take(from)?.try_into().ok()
    }
}

impl Stored for bool {
    fn put(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }

    fn take(from: &mut Bytes<'_>) -> Option<bool> {
        match u8::take(from)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Stored for String {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        out.extend(self.as_bytes());
    }

    fn take(from: &mut Bytes<'_>) -> Option<String> {
        String::from_utf8(Vec::<u8>::take(from)?).ok()
    }
}

impl<T: Stored> Stored for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut Bytes<'_>) -> Option<Option<T>> {
        match bool::take(from)? {
            true => T::take(from).map(Some),
            false => Some(None),
        }
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut Bytes<'_>) -> Option<Vec<T>> {
        let length = usize::take(from)?;
        // no value takes less than a byte
        if length > from.0.len() {
            return None;
        }
        (0..length).map(|_| T::take(from)).collect()
    }
}

impl<T: Stored, const N: usize> Stored for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut Bytes<'_>) -> Option<[T; N]> {
        let all: Option<Vec<T>> = (0..N).map(|_| T::take(from)).collect();
        all?.try_into().ok()
    }
}

impl<A: Stored, B: Stored> Stored for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(from: &mut Bytes<'_>) -> Option<(A, B)> {
        Some((A::take(from)?, B::take(from)?))
    }
}

impl Stored for DMatrix<f64> {
    fn put(&self, out: &mut Vec<u8>) {
        (self.nrows(), self.ncols()).put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut Bytes<'_>) -> Option<DMatrix<f64>> {
        let (rows, columns) = Stored::take(from)?;
        let count = usize::checked_mul(rows, columns).filter(|count| *count <= from.0.len())?;
        let values: Option<Vec<f64>> = (0..count).map(|_| f64::take(from)).collect();
        Some(DMatrix::from_vec(rows, columns, values?))
    }
}

/// Keeps a struct field by field.
macro_rules! stored {
    ($kind:ty { $($field:ident),* $(,)? }) => {
        impl $crate::report::state::codec::Stored for $kind {
            fn put(&self, out: &mut Vec<u8>) {
                // taken apart: a new field that is not kept does not compile
                let Self { $($field),* } = self;
                $($field.put(out);)*
            }

            fn take(from: &mut $crate::report::state::codec::Bytes<'_>) -> Option<Self> {
                $(let $field = $crate::report::state::codec::Stored::take(from)?;)*
                Some(Self { $($field),* })
            }
        }
    };
}

pub(super) use stored;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_with_their_bits_and_damage_is_seen() {
        let value = (vec![Some(-0.0), None, Some(f64::NAN)], ("brow, left".to_owned(), [1_usize, usize::MAX]));
        let mut bytes = Vec::new();
        value.put(&mut bytes);
        let again: (Vec<Option<f64>>, (String, [usize; 2])) = Stored::take(&mut Bytes(&bytes)).expect("whole");
        assert_eq!(again.1, value.1);
        let bits = |all: &[Option<f64>]| all.iter().map(|v| v.map(f64::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&again.0), bits(&value.0));
        for cut in 0..bytes.len() {
            assert!(<(Vec<Option<f64>>, (String, [usize; 2]))>::take(&mut Bytes(&bytes[..cut])).is_none());
        }
        // a length that no memory could hold
        assert!(Vec::<f64>::take(&mut Bytes(&[0xff; 16])).is_none());
        let matrix = DMatrix::from_fn(3, 2, |a, b| a as f64 - 0.1 * b as f64);
        let mut bytes = Vec::new();
        matrix.put(&mut bytes);
        assert_eq!(DMatrix::take(&mut Bytes(&bytes)), Some(matrix));
    }
}
