// As much of Google.Protobuf as code that protoc generates uses in its compatibility mode, so that the C# client can be compiled and run where
// NuGet cannot be reached. Messages work in memory and on the wire; descriptors and JSON do not.
using System;
using System.Collections;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Text;

namespace Google.Protobuf {

public interface IMessage {
    void MergeFrom(CodedInputStream input);
    void WriteTo(CodedOutputStream output);
    int CalculateSize();
    Reflection.MessageDescriptor Descriptor { get; }
}
public interface IMessage<T> : IMessage where T : IMessage<T> {
    void MergeFrom(T other);
    T Clone();
}
public interface IExtendableMessage<T> { }

public abstract class MessageParser {
    public abstract IMessage New();
}
public sealed class MessageParser<T> : MessageParser where T : IMessage<T> {
    readonly Func<T> make;
    public MessageParser(Func<T> make) { this.make = make; }
    public override IMessage New() { return make(); }
    public T ParseFrom(byte[] data) {
        var message = make();
        message.MergeFrom(new CodedInputStream(data));
        return message;
    }
    public T ParseFrom(ByteString data) { return ParseFrom(data.ToByteArray()); }
}

public static class MessageExtensions {
    public static byte[] ToByteArray(this IMessage message) {
        var output = new CodedOutputStream(new MemoryStream());
        message.WriteTo(output);
        return output.ToArray();
    }
}

public sealed class ByteString : IEnumerable<byte> {
    readonly byte[] bytes;
    ByteString(byte[] bytes) { this.bytes = bytes; }
    public static ByteString Empty { get; } = new ByteString(new byte[0]);
    public static ByteString CopyFrom(byte[] source, int offset, int count) { return new ByteString(source.Skip(offset).Take(count).ToArray()); }
    public static ByteString CopyFrom(params byte[] source) { return new ByteString((byte[])source.Clone()); }
    public int Length => bytes.Length;
    public byte[] ToByteArray() { return (byte[])bytes.Clone(); }
    public string ToStringUtf8() { return Encoding.UTF8.GetString(bytes); }
    public IEnumerator<byte> GetEnumerator() { return ((IEnumerable<byte>)bytes).GetEnumerator(); }
    IEnumerator IEnumerable.GetEnumerator() { return bytes.GetEnumerator(); }
}

public sealed class CodedInputStream {
    readonly byte[] data;
    int at, end;
    uint lastTag;
    public CodedInputStream(byte[] data) { this.data = data; end = data.Length; }
    ulong Varint() {
        ulong value = 0;
        for (int shift = 0;; shift += 7) {
            byte part = data[at++];
            value |= (ulong)(part & 0x7f) << shift;
            if (part < 0x80) return value;
        }
    }
    public uint ReadTag() { return lastTag = at == end ? 0 : (uint)Varint(); }
    public uint LastTag => lastTag;
    public int ReadLength() { return (int)Varint(); }
    public bool ReadBool() { return Varint() != 0; }
    public uint ReadUInt32() { return (uint)Varint(); }
    public uint ReadFixed32() { at += 4; return BitConverter.ToUInt32(data, at - 4); }
    public int ReadInt32() { return (int)Varint(); }
    public int ReadEnum() { return (int)Varint(); }
    public ulong ReadUInt64() { return Varint(); }
    public ulong ReadFixed64() { at += 8; return BitConverter.ToUInt64(data, at - 8); }
    public double ReadDouble() { at += 8; return BitConverter.ToDouble(data, at - 8); }
    public float ReadFloat() { at += 4; return BitConverter.ToSingle(data, at - 4); }
    public ByteString ReadBytes() { int size = ReadLength(); at += size; return ByteString.CopyFrom(data, at - size, size); }
    public string ReadString() { return ReadBytes().ToStringUtf8(); }
    public void ReadMessage(IMessage message) {
        int size = ReadLength(), outer = end;
        end = at + size;
        message.MergeFrom(this);
        end = outer;
    }
    public void ReadRawMessage(IMessage message) { message.MergeFrom(this); }
    public void SkipLastField() {
        switch (lastTag & 7) {
            case 0: Varint(); break;
            case 1: at += 8; break;
            case 2: int size = ReadLength(); at += size; break;
            case 5: at += 4; break;
            default: throw new InvalidDataException("wire type " + (lastTag & 7));
        }
    }
    // Packed elements, or one that is not packed.
    internal void ReadRun(bool isPacked, Action one) {
        if (!isPacked) { one(); return; }
        int stop = ReadLength();
        stop += at;
        while (at < stop) one();
    }
}

public sealed class CodedOutputStream {
    readonly MemoryStream stream;
    public CodedOutputStream(MemoryStream stream) { this.stream = stream; }
    public byte[] ToArray() { return stream.ToArray(); }
    void Varint(ulong value) {
        for (; value >= 0x80; value >>= 7) stream.WriteByte((byte)(value | 0x80));
        stream.WriteByte((byte)value);
    }
    void Raw(byte[] bytes) { stream.Write(bytes, 0, bytes.Length); }
    public void WriteRawTag(params byte[] tag) { Raw(tag); }
    public void WriteTag(uint tag) { Varint(tag); }
    public void WriteLength(int length) { Varint((ulong)length); }
    public void WriteBool(bool value) { Varint(value ? 1u : 0u); }
    public void WriteUInt32(uint value) { Varint(value); }
    public void WriteFixed32(uint value) { Raw(BitConverter.GetBytes(value)); }
    public void WriteInt32(int value) { Varint((ulong)(long)value); }
    public void WriteEnum(int value) { Varint((ulong)(long)value); }
    public void WriteUInt64(ulong value) { Varint(value); }
    public void WriteFixed64(ulong value) { Raw(BitConverter.GetBytes(value)); }
    public void WriteDouble(double value) { Raw(BitConverter.GetBytes(value)); }
    public void WriteFloat(float value) { Raw(BitConverter.GetBytes(value)); }
    public void WriteBytes(ByteString value) { WriteLength(value.Length); Raw(value.ToByteArray()); }
    public void WriteString(string value) { WriteBytes(ByteString.CopyFrom(Encoding.UTF8.GetBytes(value))); }
    public void WriteMessage(IMessage message) { WriteBytes(ByteString.CopyFrom(message.ToByteArray())); }
    public void WriteRawMessage(IMessage message) { message.WriteTo(this); }
    // Sizes are not needed: messages are written into memory first.
    public static int ComputeMessageSize(IMessage message) { return 0; }
    public static int ComputeStringSize(string value) { return 0; }
    public static int ComputeEnumSize(int value) { return 0; }
    public static int ComputeBytesSize(ByteString value) { return 0; }
    public static int ComputeUInt64Size(ulong value) { return 0; }
    public static int ComputeUInt32Size(uint value) { return 0; }
    public static int ComputeInt32Size(int value) { return 0; }
}

public sealed class UnknownFieldSet {
    public static UnknownFieldSet MergeFieldFrom(UnknownFieldSet set, CodedInputStream input) { input.SkipLastField(); return set; }
    public static UnknownFieldSet MergeFrom(UnknownFieldSet set, UnknownFieldSet other) { return set; }
    public static UnknownFieldSet Clone(UnknownFieldSet set) { return set; }
    public void WriteTo(CodedOutputStream output) { }
    public int CalculateSize() { return 0; }
}

public static class JsonFormatter {
    public static string ToDiagnosticString(IMessage message) { return message.GetType().Name; }
}
public static class ProtoPreconditions {
    public static T CheckNotNull<T>(T value, string name) where T : class { if (value == null) throw new ArgumentNullException(name); return value; }
}

public sealed class FieldCodec<T> {
    internal readonly uint Tag;
    internal readonly Func<CodedInputStream, T> Read;
    internal readonly Action<CodedOutputStream, T> Write;
    internal readonly uint WireType;  // of one element
    internal FieldCodec(uint tag, Func<CodedInputStream, T> read, Action<CodedOutputStream, T> write, uint wireType) {
        Tag = tag; Read = read; Write = write; WireType = wireType;
    }
}
public static class FieldCodec {
    public static FieldCodec<string> ForString(uint tag) { return new FieldCodec<string>(tag, i => i.ReadString(), (o, v) => o.WriteString(v), 2); }
    public static FieldCodec<float> ForFloat(uint tag) { return new FieldCodec<float>(tag, i => i.ReadFloat(), (o, v) => o.WriteFloat(v), 5); }
    public static FieldCodec<double> ForDouble(uint tag) { return new FieldCodec<double>(tag, i => i.ReadDouble(), (o, v) => o.WriteDouble(v), 1); }
    public static FieldCodec<uint> ForUInt32(uint tag) { return new FieldCodec<uint>(tag, i => i.ReadUInt32(), (o, v) => o.WriteUInt32(v), 0); }
    public static FieldCodec<uint> ForFixed32(uint tag) { return new FieldCodec<uint>(tag, i => i.ReadFixed32(), (o, v) => o.WriteFixed32(v), 5); }
    public static FieldCodec<ulong> ForUInt64(uint tag) { return new FieldCodec<ulong>(tag, i => i.ReadUInt64(), (o, v) => o.WriteUInt64(v), 0); }
    public static FieldCodec<ulong> ForFixed64(uint tag) { return new FieldCodec<ulong>(tag, i => i.ReadFixed64(), (o, v) => o.WriteFixed64(v), 1); }
    public static FieldCodec<T> ForEnum<T>(uint tag, Func<T, int> to, Func<int, T> from) {
        return new FieldCodec<T>(tag, i => from(i.ReadEnum()), (o, v) => o.WriteEnum(to(v)), 0);
    }
    public static FieldCodec<T> ForMessage<T>(uint tag, MessageParser<T> parser) where T : class, IMessage<T> {
        return new FieldCodec<T>(tag, i => { var m = (T)parser.New(); i.ReadMessage(m); return m; }, (o, v) => o.WriteMessage(v), 2);
    }
}

public abstract class Extension { }
public sealed class Extension<TTarget, TValue> : Extension {
    public Extension(int number, FieldCodec<TValue> codec) { }
}

}  // namespace Google.Protobuf

namespace Google.Protobuf.Collections {

public sealed class RepeatedField<T> : IList<T> {
    readonly List<T> values = new List<T>();
    public void Add(T value) { values.Add(value); }
    public void Add(IEnumerable<T> more) { values.AddRange(more); }
    public void AddRange(IEnumerable<T> more) { values.AddRange(more); }
    public RepeatedField<T> Clone() {
        var copy = new RepeatedField<T>();
        foreach (var value in values) copy.Add(value is IMessage ? (T)value.GetType().GetMethod("Clone").Invoke(value, null) : value);
        return copy;
    }
    public void AddEntriesFrom(CodedInputStream input, FieldCodec<T> codec) {
        bool isPacked = codec.WireType != 2 && (input.LastTag & 7) == 2;
        input.ReadRun(isPacked, () => values.Add(codec.Read(input)));
    }
    public void WriteTo(CodedOutputStream output, FieldCodec<T> codec) {
        foreach (var value in values) {
            // One by one, which every reader of packed fields accepts.
            output.WriteTag(codec.Tag & ~7u | codec.WireType);
            codec.Write(output, value);
        }
    }
    public int CalculateSize(FieldCodec<T> codec) { return 0; }
    public int Count => values.Count;
    public bool IsReadOnly => false;
    public T this[int i] { get { return values[i]; } set { values[i] = value; } }
    public bool Remove(T value) { return values.Remove(value); }
    public void Clear() { values.Clear(); }
    public bool Contains(T value) { return values.Contains(value); }
    public void CopyTo(T[] array, int at) { values.CopyTo(array, at); }
    public int IndexOf(T value) { return values.IndexOf(value); }
    public void Insert(int at, T value) { values.Insert(at, value); }
    public void RemoveAt(int at) { values.RemoveAt(at); }
    public IEnumerator<T> GetEnumerator() { return values.GetEnumerator(); }
    IEnumerator IEnumerable.GetEnumerator() { return values.GetEnumerator(); }
    public override bool Equals(object other) { return other is RepeatedField<T> && values.SequenceEqual(((RepeatedField<T>)other).values); }
    public override int GetHashCode() { return values.Count; }
}
public static class ProtobufEqualityComparers {
    public static readonly IEqualityComparer<double> BitwiseDoubleEqualityComparer = EqualityComparer<double>.Default;
    public static readonly IEqualityComparer<float> BitwiseSingleEqualityComparer = EqualityComparer<float>.Default;
}

}  // namespace Google.Protobuf.Collections

namespace Google.Protobuf.Reflection {

public sealed class MessageDescriptor {
    public IList<MessageDescriptor> NestedTypes => FileDescriptor.Some;
}
public sealed class FieldOptions { }
[AttributeUsage(AttributeTargets.Field)]
public sealed class OriginalNameAttribute : Attribute {
    public OriginalNameAttribute(string name) { }
}
public sealed class GeneratedClrTypeInfo {
    public GeneratedClrTypeInfo(Type type, MessageParser parser, string[] properties, string[] oneofs, Type[] enums, Extension[] extensions,
                                GeneratedClrTypeInfo[] nested) { }
    public GeneratedClrTypeInfo(Type[] enums, Extension[] extensions, GeneratedClrTypeInfo[] messages) { }
}
public sealed class FileDescriptor {
    internal static readonly IList<MessageDescriptor> Some = Enumerable.Repeat(new MessageDescriptor(), 1000).ToList();
    public IList<MessageDescriptor> MessageTypes => Some;
    public static FileDescriptor FromGeneratedCode(byte[] data, FileDescriptor[] dependencies, GeneratedClrTypeInfo info) { return new FileDescriptor(); }
}
public static class DescriptorReflection {
    public static FileDescriptor Descriptor { get; } = new FileDescriptor();
}

}  // namespace Google.Protobuf.Reflection
