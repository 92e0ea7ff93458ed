//! `wire`.

use crate::call::{call1, call2, call3};
use surefix_core::wire::bits::{BitCursor, Bits};
use surefix_core::wire::crc;
use surefix_core::wire::native::{self, Frame, Kind, Reader, Writer};

pub fn all() {
    let bytes: &[u8] = &[0; 64];
    call1(crc::crc24q, bytes);
    call1(crc::crc32, bytes);
    bits(bytes);
    native_frame(bytes);
}

fn bits(bytes: &[u8]) {
    call1(Bits::new, bytes);
    let bits = Bits::new(bytes);
    call1(Bits::len, &bits);
    call1(Bits::is_empty, &bits);
    call3(Bits::unsigned, &bits, 0, 0);
    call3(Bits::signed, &bits, 0, 0);
    call3(Bits::sign_magnitude, &bits, 0, 0);
    call2(BitCursor::new, bits, 0);
    let mut cursor = BitCursor::new(bits, 0);
    call1(BitCursor::position, &cursor);
    call2(BitCursor::skip, &mut cursor, 0);
    call2(BitCursor::unsigned, &mut cursor, 0);
    call2(BitCursor::signed, &mut cursor, 0);
}

fn native_frame(bytes: &[u8]) {
    call1(Kind::from_u8, 0);
    call1(Frame::expected_len, bytes);
    call1(Frame::parse, bytes);
    if let Ok((frame, _)) = Frame::parse(core::hint::black_box(bytes)) {
        call1(Frame::kind, &frame);
        call1(Frame::kind_number, &frame);
        call1(Frame::payload, &frame);
        call1(Frame::reader, &frame);
    }

    let mut out = [0; 64];
    call1(|out| Writer::is_empty(&Writer::new(out)), &mut out);
    let mut writer = Writer::new(&mut out);
    call1(Writer::len, &writer);
    call2(Writer::put_bytes, &mut writer, bytes);
    call2(Writer::put_u8, &mut writer, 0);
    call2(Writer::put_u16, &mut writer, 0);
    call2(Writer::put_u32, &mut writer, 0);
    call2(Writer::put_u64, &mut writer, 0);
    call2(Writer::put_i64, &mut writer, 0);
    call2(Writer::put_f64, &mut writer, 0.0);
    call2(Writer::put_f32, &mut writer, 0.0);

    let mut reader = Reader::new(bytes);
    call1(Reader::left, &reader);
    call1(Reader::bytes::<7>, &mut reader);
    call1(Reader::u8, &mut reader);
    call1(Reader::u16, &mut reader);
    call1(Reader::u32, &mut reader);
    call1(Reader::u64, &mut reader);
    call1(Reader::i64, &mut reader);
    call1(Reader::f64, &mut reader);
    call1(Reader::f32, &mut reader);

    let fill = |writer: &mut Writer<'_>| writer.put_bytes(core::hint::black_box(bytes));
    call3(native::encode, Kind::Report, &mut out, fill);
}
